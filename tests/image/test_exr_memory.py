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

LAYERS = (
    SCRIPT.partition("step, path")[0]
    + """
from pathlib import Path
from relume.image.files import write_layers
from relume.image.mapped_arrays import Mapped

mapped, random = Mapped(), np.random.default_rng(1)
layers = mapped.zeros(Path(sys.argv[1]), 6 * [(2000, 3000, 3)])
for layer in layers:
    for row in range(0, 2000, 100):
        layer[row : row + 100] = random.random((100, 3000, 3), np.float32)
    mapped.release()
before = peak()
write_layers(Path(sys.argv[1]) / "a.exr", {str(i): each for i, each in enumerate(layers)}, between=mapped.release)
print(peak() - before)
"""
)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak of memory is read as Linux states it")
def test_layers_that_lie_in_files_go_from_memory_as_they_are_written(tmp_path):
    said = subprocess.run([sys.executable, "-c", LAYERS, str(tmp_path)], capture_output=True, text=True, check=True)
    assert int(said.stdout) <= 2000 * 3000 * 12 / 1024  # one layer of six


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
