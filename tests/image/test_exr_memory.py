"""What reading and writing an EXR take of memory: at most its pixels as float32 and twice them."""

import subprocess
import sys

import pytest

SCRIPT = """
import sys
import numpy as np
import OpenEXR
from relume.image.files import encodings
from relume.image.files.exr import maps as exr
from relume.image.radiance import RadianceMap

def peak():
    # Not getrusage: that of a child begins with what its parent once held.
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))

step, path, half = sys.argv[1], sys.argv[2], sys.argv[3] == "half"
if step == "write":
    pixels = np.random.default_rng(1).random((2000, 3000, 3), np.float32)
    pixels += np.float32(0.01)  # in place: a copy would hide what writing takes
    before = peak()
    exr.write(path, RadianceMap(pixels), encodings.OpenEXR(half=half))
else:
    before = peak()
    exr.read(path)
print(peak() - before)
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["float", "half"])
def test_six_million_pixels_take_at_most_once_and_twice_their_size(tmp_path, kind):
    if not sys.platform.startswith("linux"):
        pytest.skip("the peak of memory is read as Linux states it")
    size = 2000 * 3000 * 12 / 1024  # KiB, as Linux says
    for step in ("write", "read"):
        command = [sys.executable, "-c", SCRIPT, step, str(tmp_path / "a.exr"), kind]
        said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        # A picture is written from where it lies, or from halves of it in a file.
        assert int(said) <= {"write": 1, "read": 2}[step] * size, step
        assert int(said) >= {"write": 0.02, "read": 0.3}[step] * size, step  # else nothing was measured
