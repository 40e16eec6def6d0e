"""What the OpenEXR library prints: gathered, and taken as what is wrong with the file."""

import os
import subprocess
import sys

import numpy as np
import OpenEXR
import pytest

from relume.errors import FormatError
from relume.image.files import read_radiance

LACKS_ITS_END = r'a\.exr: damaged EXR, bytes 342 to \d+, .*found "File terminated early"'
READ = """
import ctypes
import sys

from relume.errors import FormatError
from relume.image.files import read_radiance

ctypes.CDLL(None).puts(b"a word from elsewhere")
try:
    print(read_radiance(sys.argv[1]).size, file=sys.stderr)
except FormatError as error:
    print(error.found, file=sys.stderr)
"""


@pytest.fixture(params=["HTJ2K256", "HTJ2K32", "LJ2K"])
def picture(request, tmp_path):
    """A smooth picture, so that it is not stored as it is."""
    y, x, channel = np.indices((40, 24, 3))
    header = {"compression": getattr(OpenEXR, f"{request.param}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    pixels = (1 + x / 8 + y / 16 + channel / 2).astype(np.float16)
    OpenEXR.File(header, {"RGB": pixels}).write(str(tmp_path / "a.exr"))
    return tmp_path / "a.exr"


def without_its_end(path):
    data = path.read_bytes()
    assert data[-2:] == b"\xff\xd9"  # EOC, ISO/IEC 15444-1, table A.2
    path.write_bytes(data[:-2] + bytes(2))
    return path


def test_a_codestream_without_its_end_is_refused_and_nothing_printed(picture, capfd):
    with pytest.raises(FormatError, match=LACKS_ITS_END):
        read_radiance(without_its_end(picture))
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(sys.platform == "win32", reason="ctypes.CDLL(None), which prints by the C library, needs POSIX")
def test_what_c_holds_back_goes_where_it_belongs(picture):
    """In a program of its own, whose C writes to a pipe and therefore late."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}

    def printed(path):
        command = [sys.executable, "-c", READ, str(path)]
        child = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        return child.stdout, child.stderr

    assert printed(picture) == ("a word from elsewhere\n", "(24, 40)\n")
    assert printed(without_its_end(picture)) == ("a word from elsewhere\n", '"File terminated early"\n')
