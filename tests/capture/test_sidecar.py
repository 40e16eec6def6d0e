"""Lists of exposures beside photographs, in all the forms people keep them in."""

from pathlib import Path

import pytest

from relume.capture.exposure.sidecar import ExposureList, read_times
from relume.errors import NotABracket, UnreadableFile
from relume.image.photograph import Exposure


def listed(tmp_path: Path, text: str, name: str = "times.txt") -> ExposureList:
    (tmp_path / name).write_text(text, newline="")
    return read_times(tmp_path / name)


def exposures_listed(listing: ExposureList, *names: str, brightness=None) -> list[Exposure | None]:
    return listing.exposures_of([Path(name) for name in names], range(len(names)), brightness and (lambda: brightness))


def seconds(listing: ExposureList) -> list[float]:
    return [exposure.seconds for exposure in listing.exposures]


DEBEVEC = """\
# Filename  exposure  1/shutter_speed f/stop gain(db) ND_filters
church61.png 32       0.03125         8      0        0
church62.png 0.5      2               8      3        0
church63.png 0.25     4               8      0        1
"""


def test_debevecs_list_counts_gain_as_iso_and_filters_as_less_time(tmp_path):
    listing = listed(tmp_path, DEBEVEC)
    assert listing.names == ("church61.png", "church62.png", "church63.png")
    assert listing.exposures == (Exposure(32.0, 8.0), Exposure(0.5, 8.0, 200.0), Exposure(0.125, 8.0))
    assert [exposure.source for exposure in listing.exposures] == ["sidecar"] * 3
    assert not listing.either


def test_a_gain_of_3_decibels_doubles_the_exposure_and_half_the_f_stop_quadruples_it(tmp_path):
    text = "# name 1/shutter f/stop gain(db) ND\na.png 8 8 0 0\nb.png 8 8 3 0\nc.png 8 4 0 0\nd.png 8 8 0 2\n"
    a, b, c, d = (exposure.factor for exposure in listed(tmp_path, text).exposures)
    assert (b / a, c / a, d / a) == pytest.approx((2.0, 4.0, 0.25))


def test_the_two_real_lists_of_the_church_agree(shared):
    folder = shared / "data/brackets/memorial"
    first, second = (read_times(folder / name) for name in ("image_list.txt", "memorial.hdr_image_list.txt"))
    assert first.exposures == second.exposures
    assert (first.names[15], second.names[15]) == ("memorial0076.png", "memorial0076.ppm")
    assert first.exposures[0] == Exposure(32.0, 8.0) and first.exposures[15] == Exposure(1 / 1024, 8.0)
    assert exposures_listed(second, "memorial0062.png", "other.png") == [Exposure(16.0, 8.0), None]


def test_the_count_that_stands_before_a_list_must_be_right(tmp_path):
    text = "# Number of Images\r\n2\r\n# Filename 1/shutter_speed f/stop\r\na.ppm 4 8\r\nb.ppm 8 8\r\n"
    assert seconds(listed(tmp_path, text)) == [0.25, 0.125]
    with pytest.raises(UnreadableFile, match=r"times\.txt: says that it lists 3 photographs, and lists 2"):
        listed(tmp_path, text.replace("\n2\r", "\n3\r"))


def test_pfstools_scripts(tmp_path):
    listing = listed(tmp_path, "/a/b/IMG_1.JPG 60 5.6 200 0\n/a/b/IMG_2.JPG 15 5.6 200 1\n", "shoot.hdrgen")
    assert listing.exposures == (Exposure(1 / 60, 5.6, 200.0), Exposure(1 / 30, 5.6, 200.0))
    assert exposures_listed(listing, "elsewhere/img_1.jpg") == [Exposure(1 / 60, 5.6, 200.0)]


@pytest.mark.parametrize(
    "text",
    [
        "a.jpg 1/30\nb.jpg 2\n",
        "a.jpg,1/30\nb.jpg,2\n",
        "name;seconds\na.jpg;0.0333333333333333333\nb.jpg;2\n",
        "file,f/stop,exposure time\na.jpg,,1/30\nb.jpg,,2\n",
        'Image Name, Shutter\n"a.jpg", 1/30s\n"b.jpg", 2s\n',
        "# name 1/shutter\na.jpg 30\nb.jpg 0.5\n",
        "\ufeff# times are reciprocals, in seconds\na.jpg 30\nb.jpg 0.5\n",
        "# seconds\na.jpg 1/30\nb.jpg 2\n",
    ],
)
def test_names_and_times(tmp_path, text):
    listing = listed(tmp_path, text)
    assert listing.names == ("a.jpg", "b.jpg")
    assert seconds(listing) == pytest.approx([1 / 30, 2.0])
    assert not listing.either and [e.f_number for e in listing.exposures] == [None, None]


def test_a_column_of_stops_gives_ratios(tmp_path):
    assert seconds(listed(tmp_path, "name,EV\na.jpg,-2\nb.jpg,0\nc.jpg,1\n")) == [0.25, 1.0, 2.0]


def test_bare_numbers_are_decided_by_the_pixels(tmp_path):
    listing = listed(tmp_path, "320,160,80,40\r\n-2,-1,0,1")
    assert listing.either and listing.names == () and listing.stops == (-2.0, -1.0, 0.0, 1.0)
    names = ("1.tif", "2.tif", "3.tif", "4.tif")
    assert exposures_listed(listing, *names) == [None] * 4  # nothing is reported without a look at the pixels
    rising = exposures_listed(listing, *names, brightness=[0.1, 0.2, 0.3, 0.4])
    assert [exposure and exposure.seconds for exposure in rising] == [1 / 320, 1 / 160, 1 / 80, 1 / 40]
    with pytest.raises(NotABracket, match="neither as seconds nor as reciprocals"):  # the stops say otherwise
        exposures_listed(listing, *names, brightness=[0.4, 0.3, 0.2, 0.1])
    with pytest.raises(NotABracket, match="neither as seconds nor as reciprocals"):
        exposures_listed(listing, *names, brightness=[0.1, 0.4, 0.2, 0.3])


@pytest.mark.parametrize("brightness, first", [([0.1, 0.2, 0.3], 1 / 30), ([0.3, 0.2, 0.1], 30.0)])
def test_numbers_beside_names_are_decided_by_the_pixels_too(tmp_path, brightness, first):
    listing = listed(tmp_path, "a.jpg 30\nb.jpg 15\nc.jpg 8\n")
    exposure = exposures_listed(listing, "a.jpg", "b.jpg", "c.jpg", brightness=brightness)[0]
    assert exposure is not None and exposure.seconds == pytest.approx(first)


def test_stops_that_fit_neither_reading_are_refused(tmp_path):
    listing = listed(tmp_path, "320,160,80\n-2,0,2")
    with pytest.raises(NotABracket, match="write seconds, like 1/30"):
        exposures_listed(listing, "1.tif", "2.tif", "3.tif", brightness=[0.1, 0.2, 0.3])


def test_fractions_are_seconds_whatever_the_pixels_say(tmp_path):
    listing = listed(tmp_path, "1/30\n1/60\n")
    assert not listing.either and seconds(listing) == [1 / 30, 1 / 60]


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "lists nothing"),
        ("Photographs of the church taken by a friend.\nNo times are known.\n", "its columns"),
        ("a.jpg 1/2\nb.jpg\n", "different numbers of columns"),
        ("a.jpg 1 2 3 4\n", "nothing says what its columns are"),
        ("name,aperture\na.jpg,8\n", "names no column of times"),
        ("name,seconds\na.jpg,soon\n", '"a.jpg soon" is not an exposure'),
        ("name,seconds\na.jpg,-1\n", "is not an exposure"),
        ("name,seconds\na.jpg,0\n", "is not an exposure"),
        ("name,seconds\na.jpg,1\na.jpg,2\n", "lists a.jpg twice"),
        ("# name exposure 1/shutter\na.jpg 30 30\n", "its time and its reciprocal disagree"),
        ("1,2,3\n4,5,6\n7,8,9\n", "numbers without names"),
        ("1,0,3\n", "no list of exposure times"),
        ("a.jpg 1e400\n", "is not an exposure"),
    ],
)
def test_what_is_no_list_is_refused_in_one_line(tmp_path, text, words):
    with pytest.raises(UnreadableFile) as caught:
        listed(tmp_path, text)
    message = str(caught.value)
    assert "times.txt: " in message and words in message and "\n" not in message


def test_files_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"\xff\xd8\xff\xe0\x00")
    for path in (tmp_path / "a.txt", tmp_path / "missing.txt", tmp_path):
        with pytest.raises(UnreadableFile, match=path.name):
            read_times(path)
