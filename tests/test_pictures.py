"""Raw signals on the page: one picture of each finger's last touch, dead places marked."""

from __future__ import annotations

import base64
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from episodes import episode_of
from PIL import Image

from estimator.vectors import Array
from hand_models.hand import load_hand
from sim_sensor.viewer.episode import Episode
from sim_sensor.viewer.pictures import Signal, picture
from sim_sensor.viewer.view import write_page


def pixels(values: Array) -> Array:
    address = picture(Signal(values))
    head, data = address.split(",", 1)
    assert head == "data:image/png;base64"
    with Image.open(io.BytesIO(base64.b64decode(data))) as image:
        return np.asarray(image, dtype=int)


def test_tactels_are_squares_bright_where_most_is_felt_and_red_where_dead() -> None:
    values = np.zeros((4, 4))
    values[1, 2], values[3, 0] = 0.024, np.nan
    image = pixels(values)
    assert image.shape == (132, 132, 3)
    cells = image[16::33, 16::33]
    brightness = cells.sum(axis=-1)
    assert np.unravel_index(np.argmax(brightness), (4, 4)) == (1, 2)
    assert cells[3, 0, 0] > 2 * cells[3, 0, 1:].max()
    np.testing.assert_array_equal(image[0:33, 0:33].reshape(-1, 3).std(axis=0), 0)


def test_a_signal_of_nothing_is_dark() -> None:
    assert pixels(np.zeros((4, 4))).max() < 100


def test_a_signal_is_a_table() -> None:
    with pytest.raises(ValueError, match=r"signal: expected rows and columns, got shape \(3,\)"):
        Signal(np.zeros(3))


def test_the_page_holds_every_signal_with_its_finger_and_time(tmp_path: Path) -> None:
    hand = load_hand("allegro_right")
    episode = episode_of(hand)
    signal = Signal(np.eye(4), "2.4 % strain & more")
    acts = (replace(episode.acts[0], signal=signal), *episode.acts[1:])
    text = write_page(tmp_path / "p.html", hand, Episode(episode.surface, acts)).read_text()
    assert text.count('"image": "data:image/png;base64,') == 1
    assert '"finger": "index"' in text
    assert '"words": "2.4 % strain & more"' in text
