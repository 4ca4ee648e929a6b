"""Raw touches survive the disk, and a bad file is refused with one clear error."""

import numpy as np
import pytest

from estimator.readers.raw_files import RawTouches, read_raw, write_raw

POSES = np.tile(np.eye(4), (3, 1, 1))


def good_depth():
    depth = np.random.default_rng(0).normal(size=(3, 12, 16)) * 1e-4
    depth[0, 2, 3] = np.nan
    return {"depth": depth, "pixel_pitch": 0.2e-3, "X_WS": POSES}


def good_strains():
    return {"strains": np.full((3, 4, 4), 0.01), "X_WS": POSES}


def saved(tmp_path, arrays):
    path = tmp_path / "touches.npz"
    np.savez(path, **arrays)
    return path


def test_depth_touches_come_back_as_written(tmp_path):
    touches = RawTouches(
        **good_depth(), finger=("index", "thumb", "index"), sensor="gel-depth", pad_radius=0.03
    )
    write_raw(tmp_path / "a.npz", touches)
    back = read_raw(tmp_path / "a.npz")
    assert np.array_equal(back.depth, touches.depth, equal_nan=True)
    assert np.array_equal(back.X_WS, touches.X_WS)
    assert back.pixel_pitch == touches.pixel_pitch
    assert back.finger == touches.finger
    assert back.sensor == "gel-depth"
    assert back.pad_radius == 0.03
    assert back.strains is None
    assert len(back) == 3


def test_strains_come_back_as_written(tmp_path):
    write_raw(tmp_path / "a.npz", RawTouches(**good_strains()))
    back = read_raw(tmp_path / "a.npz")
    assert np.array_equal(back.strains, good_strains()["strains"])
    assert back.depth is None
    assert back.finger == ()
    assert np.isinf(back.pad_radius)


def test_plain_numpy_writes_the_layout_too(tmp_path):
    arrays = {
        **good_depth(),
        "finger": np.array(["a", "b", "c"]),
        "depth": np.zeros((3, 9, 9), "f4"),
    }
    assert read_raw(saved(tmp_path, arrays)).finger == ("a", "b", "c")


def test_a_failed_write_leaves_no_file_and_keeps_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    write_raw(path, RawTouches(**good_strains()))
    before = path.read_bytes()

    def broken(*_, **__):
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez_compressed", broken)
    with pytest.raises(OSError, match="disk full"):
        write_raw(path, RawTouches(**good_depth()))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def tilted():
    X = POSES.copy()
    X[1, :3, :3] *= 1.1
    return X


def mirrored():
    X = POSES.copy()
    X[2, 0, 0] = -1.0
    return X


def lost():
    X = POSES.copy()
    X[0, 1, 3] = np.nan
    return X


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"X_WS": None}, "X_WS is missing"),
        ({"pixel_pitch": None}, "pixel_pitch is missing"),
        ({"depth": None}, "either depth or strains"),
        ({"strains": np.zeros((3, 4, 4))}, "either depth or strains"),
        ({"depth": np.zeros((3, 12))}, r"depth: expected shape \(3, any, any\)"),
        ({"depth": np.zeros((2, 12, 12))}, r"X_WS: expected shape \(2, 4, 4\)"),
        ({"depth": np.zeros((0, 12, 12))}, "one touch or more"),
        ({"depth": np.full((3, 9, 9), "x")}, "depth: expected real numbers"),
        ({"depth": np.zeros((3, 9, 9), complex)}, "depth: expected real numbers"),
        ({"pixel_pitch": -1.0}, "pixel_pitch: expected > 0"),
        ({"pixel_pitch": np.zeros(2)}, "pixel_pitch: expected one number"),
        ({"pad_radius": 0.0}, "pad_radius: expected > 0"),
        ({"finger": np.array(["a", "b"])}, "finger: expected 3 names or none, got 2"),
        ({"X_WS": np.eye(4)}, "X_WS: expected shape"),
        ({"X_WS": tilted()}, "touch 2 is not one"),
        ({"X_WS": mirrored()}, "touch 3 is not one"),
        ({"X_WS": lost()}, "touch 1 is not one"),
        ({"pixel_pich": 1.0}, "pixel_pich is unknown; known are depth"),
    ],
)
def test_bad_arrays_are_named(tmp_path, change, message):
    arrays = {k: v for k, v in {**good_depth(), **change}.items() if v is not None}
    path = saved(tmp_path, arrays)
    with pytest.raises(ValueError, match=message) as caught:
        read_raw(path)
    assert str(path) in str(caught.value)


def test_strains_are_frames_of_an_array_of_any_size(tmp_path):
    frames = {**good_strains(), "strains": np.zeros((3, 8, 5))}
    assert read_raw(saved(tmp_path, frames)).strains.shape == (3, 8, 5)
    with pytest.raises(ValueError, match=r"strains: expected shape \(3, any, any\), got \(3, 16\)"):
        read_raw(saved(tmp_path, {**frames, "strains": np.zeros((3, 16))}))


def test_pickled_objects_are_refused(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, X_WS=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ValueError, match="pickled objects"):
        read_raw(path)


@pytest.mark.parametrize("content", [b"", b"not an archive", b"PK\x03\x04 broken"])
def test_files_that_are_no_archive_are_refused(tmp_path, content):
    path = tmp_path / "x.npz"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"raw touches .*npz"):
        read_raw(path)


def test_a_single_array_or_no_file_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(3))
    with pytest.raises(ValueError, match="named arrays"):
        read_raw(tmp_path / "a.npy")
    with pytest.raises(ValueError, match="no such file"):
        read_raw(tmp_path / "none.npz")
