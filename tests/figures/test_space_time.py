"""Ways through the frames of an animation, and published textures over time that a user has: here made up."""

import io

import numpy as np
import pytest
from PIL import Image

from figures.__main__ import main
from figures.making import stbn
from figures.making.fingerprint import fingerprint
from figures.ours import space_time
from figures.ours.space_time import GAP, HEAD, average, moving_picture
from figures.plot import srgb
from figures.shared.integrands import animations
from qmcjax import scenes
from qmcjax.bridges import write_image

MODULE = "figures.ours.designed_samplers"
SHAPE = (4, 8, 8)


@pytest.fixture(scope="module")
def texture():
    """Bytes of two channels, and a constant third one, as files of vectors have."""
    rng = np.random.default_rng(1)
    return np.concatenate([rng.integers(0, 256, (*SHAPE, 2)), np.zeros((*SHAPE, 1), int)], axis=-1)


def written(folder, texture, suffix, name="stbn_vec2_2Dx1D_8x8x4"):
    folder.mkdir(exist_ok=True)
    for number, frame in enumerate(texture):
        light = (frame / 255).astype(np.float32)
        options = {"transfer": "linear"} if suffix == ".png" else {}
        write_image(folder / f"{name}_{number}{suffix}", light, **options)
    return folder


@pytest.fixture
def named(texture, tmp_path, monkeypatch):
    """Name the folder, as the command line does."""
    folder = written(tmp_path / "texture", texture, ".png")
    monkeypatch.setenv(stbn.SWITCH, str(folder))
    space_time._texture.cache_clear()
    yield folder
    space_time._texture.cache_clear()


@pytest.mark.parametrize("suffix", stbn.SUFFIXES)
def test_textures_are_read(texture, tmp_path, suffix):
    found = stbn.read(written(tmp_path / "t", texture, suffix))
    assert found.shape == (*SHAPE, 2)
    expected = (texture[..., :2] + 0.5) / 256 if suffix == ".png" else texture[..., :2] / 255
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert found.max() < 1


def test_all_bits_and_one_channel(texture, tmp_path):
    wide = np.random.default_rng(2).integers(0, 65536, SHAPE)
    for number, frame in enumerate(wide):
        path = tmp_path / f"stbn_scalar_{number}.png"
        write_image(path, (frame / 65535).astype(np.float32), transfer="linear", bits=16)
    np.testing.assert_allclose(stbn.read(tmp_path)[..., 0], (wide + 0.5) / 65536, atol=1e-9)
    grey = np.repeat(texture[..., :1], 3, axis=-1)
    assert stbn.read(written(tmp_path / "grey", grey, ".png")).shape == (*SHAPE, 1)


def test_eleven_frames_are_in_the_order_of_numbers(tmp_path):
    levels = np.arange(11)[:, None, None] * 20 + np.arange(4).reshape(2, 2)
    found = stbn.read(written(tmp_path / "t", levels, ".png"))
    np.testing.assert_array_equal(found[:, 0, 0, 0], (20 * np.arange(11) + 0.5) / 256)


def test_history_moves_with_the_camera():
    """By whole pixels and fractions, as bilinear interpolation in a loop over frames does."""
    error = np.random.default_rng(3).normal(size=(5, 8, 6, 2))
    mean, (down, across) = error.mean(axis=0), space_time.PAN
    for _ in range(40):
        found = []
        for frame in error:
            for axis, pan in ((0, down), (1, across)):
                near, far = (np.roll(mean, int(pan) + k, axis) for k in (0, 1))
                mean = near + pan % 1 * (far - near)
            mean = mean + space_time.ALPHA * (frame - mean)
            found.append(mean)
    expected = np.sqrt(np.mean(np.square(found)))
    np.testing.assert_allclose(space_time.columns(np.tile(error, (8, 1, 1, 1)))[-1], expected, rtol=1e-5)


def test_wrong_folders_are_named(texture, tmp_path, capsys):
    def refused(folder, said):
        with pytest.raises(ValueError, match=said):
            stbn.read(folder)

    refused(tmp_path / "none", "must have the files NAME_0.png.* of one, got none")
    two = written(written(tmp_path / "two", texture, ".png"), texture, ".png", "other")
    refused(two, "of one, got other.png, stbn_vec2")
    gap = written(tmp_path / "gap", texture, ".npy")
    (gap / "stbn_vec2_2Dx1D_8x8x4_2.npy").unlink()
    refused(gap, "stbn_vec2_2Dx1D_8x8x4_2.npy is missing")
    refused(written(tmp_path / "far", 2 * texture, ".npy"), r"values in \[0, 1\]")
    refused(written(tmp_path / "same", 0 * texture + 9, ".npy"), "must have values that differ")
    uneven = written(tmp_path / "uneven", texture, ".npy")
    np.save(uneven / "stbn_vec2_2Dx1D_8x8x4_3.npy", np.zeros((4, 8, 3), np.float32))
    refused(uneven, r"shape of frame 0, \(8, 8, 3\), got \(4, 8, 3\)")
    with pytest.raises(SystemExit):
        main(["designed-samplers", "--out", str(tmp_path / "out"), "--stbn", str(tmp_path / "gap")])
    assert "--stbn" in capsys.readouterr().err


@pytest.mark.slow
def test_a_named_texture_counts_for_the_figure_and_gives_its_values(texture, named, monkeypatch):
    frames = space_time.published(8, 1, 2, 0)
    y, x = np.mgrid[:8, :8].astype(np.uint32)
    for t in range(len(texture)):
        found = np.asarray(frames(t).sampler(x, y, 0))
        np.testing.assert_allclose(found, (texture[t, ..., :2] + 0.5) / 256, atol=1e-6)
    first = fingerprint(MODULE, "draft"), fingerprint("figures.hilbert.hilbert_1", "draft")
    write_image(named / "stbn_vec2_2Dx1D_8x8x4_1.png", np.zeros((8, 8, 3), np.float32), transfer="linear")
    second = fingerprint(MODULE, "draft"), fingerprint("figures.hilbert.hilbert_1", "draft")
    assert first[0] != second[0]
    assert first[1] == second[1]
    monkeypatch.delenv(stbn.SWITCH)
    assert fingerprint(MODULE, "draft") != second[0]


def points(name, spp=1, dims=2, side=8, frame=0, key=3):
    """Return the points of a frame, shape (side, side, spp, dims)."""
    of = animations.METHODS[name](side, spp, dims, key)(frame)
    y, x, sample = np.indices((side, side, spp)).astype(np.uint32)
    return (
        np.asarray(of.sampler(x, y, np.uint32(of.first) + sample, dims=tuple(range(dims)))) + of.shift
    ) % 1


@pytest.mark.parametrize("name", animations.METHODS)
def test_frames_and_keys_differ(name):
    first = points(name)
    assert first.shape == (8, 8, 1, 2)
    assert not np.array_equal(first, points(name, frame=1))
    assert not np.array_equal(first, points(name, key=4))


def test_golden_shifts_are_multiples_of_one_step():
    root = (1 + np.sqrt(5)) / 2
    assert animations.METHODS["Z, golden shifts"](8, 1, 1, 3)(1).shift[0] == pytest.approx(1 / root)
    first, fifth = points("Z, golden shifts", dims=4), points("Z, golden shifts", dims=4, frame=5)
    step = (points("Z, golden shifts", dims=4, frame=1) - first) % 1
    np.testing.assert_allclose(abs((first + 5 * step - fifth + 0.5) % 1 - 0.5), 0, atol=1e-5)


def test_samples_of_frames_are_those_of_one_pixel():
    """All 32 frames of a pixel stratify it, in both coordinates."""
    name = "Z, sample = frame"
    drawn = np.stack([points(name, frame=t)[:, :, 0] for t in range(animations.FRAMES)])
    cells = np.sort(np.floor(drawn * animations.FRAMES), axis=0)
    np.testing.assert_array_equal(cells, np.broadcast_to(np.arange(32)[:, None, None, None], cells.shape))


def test_white_noise_has_ratio_one():
    """The expected errors of white noise are in closed form; 12 keys of it, within 5 standard errors."""
    expected = np.array(space_time.white((32, 16, 16), 4))
    again = 0.9**32  # of the weight of a frame, when it comes back
    average = np.sqrt(0.1 / 1.9 * (1 + again) / (1 - again))
    np.testing.assert_allclose(expected[[3, 4, 5]] * 2, [average, 8**-0.5, 8**-0.5], rtol=1e-12)
    rng = np.random.default_rng(5)
    found = np.array([space_time.columns(rng.normal(0, 0.5, (32, 16, 16, 8))) for _ in range(12)]) / expected
    squares = found**2
    assert np.all(abs(squares.mean(axis=0) - 1) < 5 * squares.std(axis=0, ddof=1) / np.sqrt(12))


def test_verdicts_say_what_is_undecided():
    rng = np.random.default_rng(6)
    noise = rng.normal(0, 0.01, (3, 16, 2))
    means = {"a": [0.0, 0.0], "b": [0.5, 0.0], "c": [1.0, 1.0]}
    logs = {name: noise[k] + mean for k, (name, mean) in enumerate(means.items())}
    said = space_time.verdicts(logs, ["one", "two"])
    assert said["one"] == "a least"
    assert said["two"].startswith("undecided: ") and "c" not in said["two"].replace("undecided", "")


def test_the_moving_picture_has_all_frames_and_their_averages():
    """Black and white frames in turn: the average of alpha swings by alpha / (2 - alpha) around the mean."""
    frames = np.broadcast_to((np.arange(8) % 2)[:, None, None], (8, 6, 10)).astype(float)
    swing = average(frames, 0.2, rounds=20) - 0.5
    np.testing.assert_allclose(swing, (frames - 0.5) * 0.2 / 1.8, atol=1e-6)
    file = moving_picture({"a": frames, "b": 1 - frames}, 0.2)
    with Image.open(io.BytesIO(file)) as picture:
        assert picture.n_frames == 8
        assert picture.info["loop"] == 0
        shown = []
        for t in range(8):
            picture.seek(t)
            shown.append(np.asarray(picture.convert("L"), float)[HEAD:])
    shown = np.array(shown)
    assert shown.shape[2] == 2 * 20 + GAP
    left, right = shown[:, 3:9, 5:15].mean(axis=(1, 2)), shown[:, 3:9, 29:39].mean(axis=(1, 2))
    np.testing.assert_allclose(left, 255 * (np.arange(8) % 2), atol=12)
    np.testing.assert_allclose(right, 255 - left, atol=12)
    below = shown[:, -9:-3, 5:15].mean(axis=(1, 2))
    assert np.all(abs(below - 255 * srgb(np.array(0.5))) < 30)


@pytest.mark.slow
def test_a_soft_shadow_converges_on_its_exact_image_and_its_picture_is_light():
    scene = scenes.soft_shadow()
    exact, _ = scene.reference(16, 16)
    way = animations.METHODS["Z, sample = frame"](16, 1, 4, 1)
    frames = [np.asarray(animations.image(way(t), 16, 16, 1, 4, space_time.shadow)) for t in range(32)]
    assert np.sqrt(np.mean((np.mean(frames, axis=0) - exact) ** 2)) < 0.03
    assert len(space_time.moving()) < 300e3
