"""Images that figures hand out: what their PNGs, differences and spectra say."""

import io

import numpy as np
import pytest
from PIL import Image
from refusals import refused

from figures.making.web_images import encode

SIDE = 16
GREY = np.full((SIDE, SIDE), 0.25)


def read(file):
    """Return bytes of grey or colours; WebPs have no greys of their own."""
    image = np.asarray(Image.open(io.BytesIO(file)).convert("RGB"))
    return image[..., 0] if (image == image[..., :1]).all() else image


def shades(file):
    """Return the shades of a spectrum from 0, black, to 15, white."""
    assert (read(file) % 17 == 0).all()
    return read(file) // 17


def test_floats_are_linear_values_and_bytes_are_kept():
    files, described = encode({"reference": GREY, "dark": GREY - 1, "bright": GREY + 9})
    assert (read(files["reference.webp"]) == round(255 * (1.055 * 0.25 ** (1 / 2.4) - 0.055))).all()
    assert (read(files["dark.webp"]) == 0).all() and (read(files["bright.webp"]) == 255).all()
    assert "sRGB" in described["transfer"]

    colours = np.arange(SIDE * SIDE * 3, dtype=np.uint8).reshape(SIDE, SIDE, 3)
    files, described = encode({"reference": colours, "other": colours[::-1]})
    assert (read(files["other.webp"]) == colours[::-1]).all()
    assert described["transfer"] == "values as they are"
    assert described["items"][1]["rms"] <= 1, "of the range of bytes"


def test_differences_are_signed_and_of_one_scale_for_as_many_samples():
    steps = np.zeros((SIDE, SIDE))
    steps[:, : SIDE // 2] = 0.04
    images = {"reference": GREY, "Z, 4 spp": GREY + steps, "random, 4 spp": GREY - 2 * steps}
    files, described = encode(images | {"Z, 16 spp": GREY + steps / 40})
    first, *others = described["items"]
    assert first == {"name": "reference", "file": "reference.webp"}
    assert [(item["name"], item["spp"]) for item in others] == [("Z", 4), ("random", 4), ("Z", 16)]
    assert [item["scale"] for item in others] == [0.2, 0.2, 0.005], (
        "three times the largest RMS or somewhat more"
    )
    assert others[0]["rms"] == pytest.approx(0.04 / np.sqrt(2))
    too_bright, too_dark = (read(files[item["difference"]]) for item in others[:2])
    assert too_bright[0, 0] == pytest.approx(127.5 * 1.2, abs=1)
    assert too_dark[0, 0] == pytest.approx(127.5 * 0.6, abs=1)
    assert too_bright[0, -1] == too_dark[0, -1] == 128, "mid-grey is none"
    assert read(files[others[2]["difference"]])[0, 0] == pytest.approx(127.5 * 1.2, abs=1)
    lamp = GREY.copy()
    lamp[3, 4] = 9
    files, _ = encode({"reference": GREY, "lamp": lamp})
    assert read(files["lamp.difference.webp"])[3, 4] == 255


def test_a_wave_is_two_points_of_its_spectrum():
    """At its frequency left and right of the middle; white noise is a grey between black and white."""
    x = np.arange(SIDE)
    wave = np.broadcast_to(np.cos(2 * np.pi * 3 * x / SIDE), (SIDE, SIDE))
    noise = np.random.default_rng(1).normal(size=(SIDE, SIDE))
    files, _ = encode({"reference": GREY, "wave": GREY + wave, "noise": GREY + noise, "none": GREY})
    found = shades(files["wave.spectrum.webp"])
    bright = {tuple(place) for place in np.argwhere(found == 15).tolist()}
    assert bright == {(SIDE // 2, SIDE // 2 - 3), (SIDE // 2, SIDE // 2 + 3)}
    assert 5 < np.mean(shades(files["noise.spectrum.webp"])) < 9
    assert (shades(files["none.spectrum.webp"]) == 0).all()


test_other_things_are_refused = refused(
    ([GREY], TypeError, "images must be a mapping of names to arrays, got list"),
    ({1: GREY}, TypeError, "images must be a mapping of names"),
    ({}, ValueError, "must have a reference"),
    ({"a": GREY, "b": np.ones((SIDE, SIDE), int)}, TypeError, "floats or uint8, got int64 for 'b'"),
    ({"a": GREY, "b": GREY.astype(np.uint8)}, TypeError, "all of floats or all of uint8"),
    ({"a": GREY, "b": GREY[1:]}, ValueError, r"one shape .* got \(15, 16\) for 'b'"),
    ({"a": np.zeros((4, 4, 2))}, ValueError, r"got \(4, 4, 2\) for 'a'"),
    ({"a": GREY, "b": GREY * np.nan}, ValueError, "finite, got others in 'b'"),
    ({"a": GREY, "Z!": GREY, "z": GREY}, ValueError, "differ in letters or digits"),
    call=encode,
)
