"""The command that writes a mask of blue noise."""

import numpy as np
import pytest

from figures.__main__ import main
from qmcjax import samplers


def test_a_mask_is_written_or_the_file_stays(tmp_path, capsys):
    path = tmp_path / "mask.npy"
    arguments = ["mask", "--channels", "1", "--out", str(path)]
    assert main([*arguments, "--side", "16", "--frames", "2"]) == 0
    assert np.array_equal(np.load(path), samplers.blue_noise_mask(1, 16, 2))
    for side in ("48", "8"):
        with pytest.raises(SystemExit):
            main([*arguments, "--side", side])
        assert "side must be a power of two" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["mask.npy"] and np.load(path).shape == (2, 16, 16)
