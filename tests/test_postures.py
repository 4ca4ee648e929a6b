"""Promise: the posture library is within limits, free of self-collision, and cached safely."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_models.cache import cache_directory, cached_arrays, hand_fingerprint
from hand_models.collision import HandCollision
from hand_models.hand import Hand, load_hand
from hand_models.postures import Postures, posture_library, start_posture


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("allegro_right")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("AXIS_BY_TOUCH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def _same(a: Postures, b: Postures) -> bool:
    return np.array_equal(a.q, b.q) and np.array_equal(a.pad_centres, b.pad_centres)


def test_postures_are_within_limits_and_free_of_self_collision(hand: Hand, cache: Path) -> None:
    postures = posture_library(hand, count=400)
    assert postures.q.shape == (400, hand.model.nq)
    assert np.all((postures.q >= hand.lower) & (postures.q <= hand.upper))
    collision = HandCollision(hand)
    assert all(collision.self_clearance(q).distance > 0.0 for q in postures.q[:100])


def test_pads_of_postures_agree_with_pinocchio_to_1e_12(hand: Hand, cache: Path) -> None:
    postures = posture_library(hand, count=20)
    for k in range(20):
        pose = hand.at(postures.q[k])
        np.testing.assert_allclose(postures.pad_centres[k], pose.pad_centres, atol=1e-12)
        np.testing.assert_allclose(postures.pad_normals[k], pose.pad_normals, atol=1e-12)


def test_a_second_call_reads_what_the_first_wrote(
    hand: Hand, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = posture_library(hand, count=30)
    monkeypatch.setattr("hand_models.postures._draw", None)  # building again would fail
    assert _same(first, posture_library(hand, count=30))
    assert not first.q.flags.writeable


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 cut short", b"not an archive"])
def test_a_damaged_cache_is_rebuilt_and_repaired(hand: Hand, cache: Path, damage: bytes) -> None:
    first = posture_library(hand, count=30)
    (file,) = cache.iterdir()
    whole = file.read_bytes()
    file.write_bytes(damage or whole[: len(whole) // 2])
    assert _same(first, posture_library(hand, count=30))
    assert len(file.read_bytes()) == len(whole)


def test_a_cache_that_lacks_an_array_is_rebuilt(cache: Path) -> None:
    cached_arrays("x", ("a",), lambda: {"a": np.zeros(2)})
    both = cached_arrays("x", ("a", "b"), lambda: {"a": np.ones(2), "b": np.ones(3)})
    np.testing.assert_array_equal(both["a"], np.ones(2))


def test_a_cache_that_cannot_be_written_still_gives_postures(
    hand: Hand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setenv("AXIS_BY_TOUCH_CACHE", str(blocked / "below"))
    assert len(posture_library(hand, count=5)) == 5


def test_a_write_that_fails_leaves_no_half_file(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*args: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", fail)
    cached_arrays("x", ("a",), lambda: {"a": np.zeros(2)})
    assert list(cache.iterdir()) == []


def test_another_seed_another_hand_another_library(hand: Hand, cache: Path) -> None:
    assert not _same(posture_library(hand, count=30), posture_library(hand, count=30, seed=1))
    left = load_hand("allegro_left")
    assert hand_fingerprint(hand) != hand_fingerprint(left)
    assert hand_fingerprint(hand) == hand_fingerprint(load_hand("allegro_right"))


def test_the_cache_folder_follows_the_platform(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AXIS_BY_TOUCH_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    assert cache_directory() == Path("/somewhere/axis-by-touch")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr("sys.platform", "linux")
    assert cache_directory() == Path.home() / ".cache" / "axis-by-touch"


def test_an_empty_library_is_refused(hand: Hand) -> None:
    with pytest.raises(ValueError, match="count must be at least 1"):
        posture_library(hand, count=0)


@pytest.mark.parametrize("name", ["psyonic_right", "allegro_right", "allegro_right_ur5"])
def test_a_hand_begins_where_its_links_are_apart_and_near_home(name: str) -> None:
    """Psyonic's thumb meets its index finger in mid-range, by 2.8 mm."""
    hand = load_hand(name)
    collision, start = HandCollision(hand), start_posture(hand)
    assert collision.self_clearance(start).distance > 1e-3
    assert np.max(np.abs(start - hand.home) / (hand.upper - hand.lower)) < 0.1
    if collision.self_clearance(hand.home).distance > 0.0:
        np.testing.assert_array_equal(start, hand.home)
    else:
        assert name == "psyonic_right"
