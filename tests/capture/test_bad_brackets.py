"""What is no bracket is refused in one line that names the file and says what to do."""

from dataclasses import replace

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.merging import merge
from relume.capture.response.calibration import recover_response
from relume.errors import NotABracket, UnreadableFile
from relume.image import files
from relume.image.photograph import Exposure, Photograph
from relume.image.response import Response
from synthetic import NOISELESS, wide_scene


def grey(
    name: str, exposure: Exposure | None, *, side: int = 32, value: int = 100, kind: type = np.uint8
) -> Photograph:
    return Photograph(np.full((side, side, 3), value, kind), name, exposure)


def straight() -> Response:
    return Response(np.tile(np.linspace(-5, 0, 256), (3, 1)), np.full(3, 0.5))


def refused(make, *words: str) -> str:
    """The refusal of `make()`: one line that holds every word."""
    with pytest.raises(NotABracket) as caught:
        make()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message
    return message


def test_no_photographs():
    refused(lambda: Bracket(()), "no photographs", "name at least one file")
    refused(lambda: read_bracket([]), "no photographs", "name at least one file")


def test_a_photograph_without_exposure():
    frames = (grey("a.jpg", Exposure(0.1)), grey("b.jpg", None))
    refused(lambda: Bracket(frames), "b.jpg", "no exposure time", "--times")


def test_photographs_of_different_sizes_or_depths():
    small = (grey("a.jpg", Exposure(0.1)), grey("b.jpg", Exposure(0.2), side=31))
    refused(lambda: Bracket(small), "b.jpg is 31×31", "a.jpg is 32×32", "one size and depth")
    deep = (grey("a.jpg", Exposure(0.1)), grey("b.tif", Exposure(0.2), kind=np.uint16))
    refused(lambda: Bracket(deep), "b.tif is 32×32 uint16", "a.jpg is 32×32 uint8", "one size and depth")


@pytest.mark.parametrize(
    "with_it, word", [(Exposure(0.1, 8.0), "f_number"), (Exposure(0.1, None, 100), "iso")], ids=["f-number", "ISO"]
)
def test_an_aperture_or_gain_that_only_some_frames_have(with_it, word):
    frames = (grey("a.jpg", with_it), grey("b.jpg", Exposure(0.2)))
    refused(lambda: Bracket(frames), "b.jpg", word, "--times")


@pytest.mark.parametrize(
    "value, words", [(255, ("saturated", "shorter exposures")), (0, ("black", "longer exposures"))]
)
def test_photographs_that_are_all_white_or_all_black(value, words):
    frames = tuple(grey(f"all_{i}.jpg", Exposure(2.0**-i), value=value) for i in range(3))
    refused(lambda: merge(Bracket(frames), straight()), "all_2.jpg … all_0.jpg", *words)
    refused(lambda: recover_response(Bracket(frames)), "all_2.jpg … all_0.jpg", "well exposed")


def test_photographs_of_16_bits_and_a_response_of_8():
    frames = tuple(grey(f"deep_{i}.tif", Exposure(2.0**-i), value=30000, kind=np.uint16) for i in range(2))
    words = "deep_1.tif … deep_0.tif: uint16 photographs", "a response of 256 values", "response of 65536 values"
    refused(lambda: merge(Bracket(frames), straight()), *words)


def test_photographs_of_one_exposure_only():
    scene = wide_scene(48, 32)
    one = NOISELESS.bracket(scene, [0.1])
    same = NOISELESS.bracket(scene, [0.1, 0.1, 0.1])
    refused(lambda: recover_response(one), "frame_0.jpg", "one photograph", "add differently", "profile")
    refused(lambda: recover_response([one, same]), "frame_0.jpg", "no two photographs differ in exposure")


def test_exposures_so_far_apart_that_nothing_is_seen_twice():
    frames = NOISELESS.bracket(wide_scene(48, 32, stops=3.0, brightest=1.0), [0.5, 5000.0])
    refused(lambda: recover_response(frames), "frame_0.jpg … frame_1.jpg", "smaller exposure steps")


def test_one_path_where_a_list_is_wanted(tmp_path):
    refused(lambda: read_bracket(str(tmp_path)), str(tmp_path), "one path", "give a list")


def test_a_wrong_number_of_times(tmp_path):
    path = tmp_path / "a.png"
    files.write(path, grey("a.png", None))
    refused(lambda: read_bracket([path], times=[0.1, 0.2]), "2 times", "1 photographs", "give one a photograph")
    assert read_bracket([path], times=[0.25]).exposures.tolist() == [0.25]


def test_times_given_by_hand_replace_the_whole_exposure(tmp_path):
    for name, exposure in [("a.png", Exposure(0.1, 8.0, 400)), ("b.png", Exposure(0.2, 8.0, 400))]:
        files.write(tmp_path / name, grey(name, exposure))
    bracket = read_bracket([tmp_path / "b.png", tmp_path / "a.png"], times=[3.0, 1.0])
    assert [p.exposure for p in bracket.photographs] == [Exposure(1.0), Exposure(3.0)]
    assert [p.name[-5:] for p in bracket.photographs] == ["a.png", "b.png"]


def test_a_file_that_is_missing_or_no_photograph(tmp_path):
    for path in (tmp_path / "missing.jpg", tmp_path / "text.jpg"):
        if path.name == "text.jpg":
            path.write_text("no photograph")
        with pytest.raises(UnreadableFile) as caught:
            read_bracket([path])
        assert path.name in str(caught.value) and "\n" not in str(caught.value)


def test_a_bracket_is_sorted_by_exposure_whatever_its_shutter():
    frames = (
        grey("long.jpg", Exposure(1.0, 16.0)),
        grey("short.jpg", Exposure(0.01, 1.0)),
        grey("middle.jpg", Exposure(0.5, 10.0)),
    )
    bracket = Bracket(frames)
    assert [p.name for p in bracket.photographs] == ["long.jpg", "middle.jpg", "short.jpg"]
    assert bracket.exposures == pytest.approx([1 / 256, 0.005, 0.01])
    assert bracket.name == "long.jpg … short.jpg"
    assert Bracket((replace(frames[0], name="alone.jpg"),)).name == "alone.jpg"


def test_a_colour_that_no_pixel_can_have_is_refused(tmp_path):
    files.write(tmp_path / "a.png", grey("a.png", Exposure(0.1)))
    refused(lambda: read_bracket([tmp_path / "a.png"], ignore=(300, 0, 0)), "a.png", "300,0,0", "from 0 to 255")
