"""Where exposures come from, in a fixed order, and what is said of each."""

import shutil
import warnings
from dataclasses import replace

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket, FrameFacts, read_bracket
from relume.capture.exposure.exposures import estimated, true_shutter
from relume.capture.exposure.folder import expand
from relume.capture.exposure.named_times import seconds_in_names, times_in_names
from relume.errors import NotABracket, UnreadableFile
from relume.image import files
from relume.image.photograph import Exposure, Photograph
from shoots import real_bracket
from synthetic import VirtualCamera, wide_scene

TIMES = (1 / 60, 1 / 15, 1 / 4)


def encoded(radiance: np.ndarray) -> np.ndarray:
    """Pixels of a camera that writes sRGB (IEC 61966-2-1)."""
    x = np.clip(radiance, 0, 1)
    return np.rint(255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)).astype(np.uint8)


def shot(folder, *, names=("a.png", "b.png", "c.png"), exif=True):
    """Three photographs of one scene written to a folder, with or without EXIF."""
    scene = wide_scene(120, 80, stops=8.0, brightest=8.0)
    paths = []
    for name, time in zip(names, TIMES, strict=True):
        exposure = Exposure(time, 8.0, 100) if exif else None
        files.write(folder / name, Photograph(encoded(scene * time), exposure=exposure))
        paths.append(folder / name)
    return paths


def sources(bracket: Bracket) -> list[str]:
    return [line.source for line in bracket.exposure_table]


def seconds(bracket: Bracket) -> list[float]:
    return [line.seconds for line in bracket.exposure_table]


def test_exif_is_used_where_nothing_stronger_speaks(tmp_path):
    bracket = read_bracket(shot(tmp_path))
    assert seconds(bracket) == list(TIMES)
    assert sources(bracket) == ["EXIF"] * 3


def test_a_list_beside_the_photographs_is_stronger_than_exif(tmp_path):
    paths = shot(tmp_path)
    (tmp_path / "times.txt").write_text("a.jpg 1/100\nb.jpg 1/25\nc.jpg 1/6\n")
    bracket = read_bracket(paths)
    assert seconds(bracket) == [0.01, 0.04, 1 / 6]
    assert sources(bracket) == ["sidecar"] * 3
    assert [p.exposure.f_number for p in bracket.photographs if p.exposure] == [None] * 3  # nothing of EXIF is left
    assert sources(read_bracket(paths, sidecars=False)) == ["EXIF"] * 3


def test_times_given_are_stronger_than_a_list(tmp_path):
    paths = shot(tmp_path)
    (tmp_path / "times.txt").write_text("a.jpg 1/100\nb.jpg 1/25\nc.jpg 1/6\n")
    bracket = read_bracket(paths, times=[1.0, 2.0, 4.0])
    assert (seconds(bracket), sources(bracket)) == ([1.0, 2.0, 4.0], ["given"] * 3)


def test_a_list_given_by_its_path_counts_as_given(tmp_path):
    (tmp_path / "far").mkdir()
    paths = shot(tmp_path)
    (tmp_path / "far/list.csv").write_text("name,seconds,f/stop\nc.png,4,8\na.png,1,8\nb.png,2,8\n")
    bracket = read_bracket(paths, times=tmp_path / "far/list.csv")
    assert (seconds(bracket), sources(bracket)) == ([1.0, 2.0, 4.0], ["given"] * 3)
    (tmp_path / "far/bare.txt").write_text("1/8 1/4 1/2")
    assert seconds(read_bracket(paths, times=str(tmp_path / "far/bare.txt"))) == [0.125, 0.25, 0.5]


def test_a_list_given_that_does_not_fit_is_refused(tmp_path):
    paths = shot(tmp_path)
    (tmp_path / "other.txt").write_text("x.png 1/2\ny.png 1\n")
    with pytest.raises(NotABracket, match=r"other\.txt: names none of the photographs, such as .*a\.png"):
        read_bracket(paths, times=tmp_path / "other.txt")
    (tmp_path / "two.txt").write_text("1/2 1/4")
    with pytest.raises(NotABracket, match=r"two\.txt: 2 times for 3 photographs"):
        read_bracket(paths, times=tmp_path / "two.txt")
    with pytest.raises(UnreadableFile, match=r"none\.txt: no such file"):
        read_bracket(paths, times=tmp_path / "none.txt")


def test_a_list_that_leaves_some_out_is_reported_and_exif_speaks_for_them(tmp_path):
    paths = shot(tmp_path)
    (tmp_path / "times.txt").write_text("a.jpg 1/60\nb.jpg 1/15\n")
    with pytest.warns(UserWarning, match=r"times\.txt: does not name c\.png; add them"):
        bracket = read_bracket(paths)
    assert sources(bracket) == ["sidecar", "sidecar", "EXIF"]
    # On one scale: the list says no aperture and no ISO, so the photographs' own stand in.
    assert [(line.f_number, line.iso) for line in bracket.exposure_table] == [(8.0, 100.0)] * 3


@pytest.mark.parametrize(
    "text, words",
    [
        ("x.jpg 1/60\ny.jpg 1/15\n", r"times\.txt: lists exposures, but of none of the photographs"),
        ("a.png soon\nb.png 1/15\nc.png 1/4\n", r'times\.txt: .*"a\.png soon".*; it is passed over'),
    ],
    ids=["of other photographs", "meant, but not read"],
)
def test_a_list_that_gives_nothing_is_reported_and_passed_over(tmp_path, text, words):
    paths = shot(tmp_path)
    (tmp_path / "times.txt").write_text(text)
    with pytest.warns(UserWarning, match=words):
        assert sources(read_bracket(paths)) == ["EXIF"] * 3


def test_two_lists_agree_or_are_refused(tmp_path):
    paths = shot(tmp_path)
    (tmp_path / "one.txt").write_text("a.jpg 1/100\nb.jpg 1/25\nc.jpg 1/5\n")
    (tmp_path / "two.csv").write_text("name,exposure,f/stop\na.jpg,0.02,8\nb.jpg,0.08,8\nc.jpg,0.4,8\n")
    assert seconds(read_bracket(paths)) == [0.01, 0.04, 0.2]  # the first by name; a common factor is no disagreement
    (tmp_path / "two.csv").write_text("name,exposure\na.jpg,0.01\nb.jpg,0.05\nc.jpg,0.2\n")
    with pytest.raises(NotABracket, match=r"one\.txt and .*two\.csv disagree about b\.png"):
        read_bracket(paths)


def test_prose_and_numbers_that_are_no_times_are_passed_over_in_silence(tmp_path):
    paths = shot(tmp_path)
    (tmp_path / "README.txt").write_text("Taken in the church.\nNo times are known, alas.\n")
    (tmp_path / "notes.txt").write_text("42\n")
    assert sources(read_bracket(paths)) == ["EXIF"] * 3


def test_bare_numbers_count_the_pictures_of_the_folder(tmp_path):
    paths = shot(tmp_path, exif=False)
    (tmp_path / "ev.txt").write_text("60,15,4")
    assert seconds(read_bracket(paths[1:])) == [1 / 15, 1 / 4]  # the second and third of the three in the folder
    (tmp_path / "ev.txt").write_text("60,15")
    with pytest.warns(UserWarning) as caught:
        bracket = read_bracket(paths)
    assert "ev.txt: 2 numbers for 3 photographs" in str(caught[0].message)
    assert sources(bracket) == ["estimated"] * 3


def test_without_any_times_the_ratios_are_estimated_and_said_to_be(tmp_path):
    paths = shot(tmp_path, exif=False)
    with pytest.warns(UserWarning, match="only the ratios 1 : .* under an assumed sRGB curve; give the exposure times"):
        bracket = read_bracket(paths)
    assert sources(bracket) == ["estimated"] * 3
    assert [line.stops for line in bracket.exposure_table] == pytest.approx([0.0, 2.0, np.log2(15)], abs=0.02)
    assert seconds(bracket)[1] == 1.0


def test_file_names_that_read_like_times_are_reported_and_not_believed(tmp_path):
    paths = shot(tmp_path, names=("1_60.png", "1_15.png", "1_4.png"), exif=False)
    with pytest.warns(UserWarning, match=r"if they are, give --times-from-names \(1/60, 1/15, 1/4 s\)"):
        bracket = read_bracket(paths)
    assert sources(bracket) == ["estimated"] * 3
    wrong = shot(tmp_path, names=("1_2.png", "1_9.png", "1_3.png"), exif=False)
    with pytest.warns(UserWarning, match="read like times, but not of these photographs"):
        read_bracket(wrong)


@pytest.mark.parametrize(
    "names, times",
    [
        (("1_25.jpg", "17_1.jpg", "1_4.jpg"), ["1/25", "17", "1/4"]),
        (("img_0.033.jpg", "img_15.jpg", "img_2.5.jpg"), ["0.033", "15", "2.5"]),
        (("x-1-250s.jpg", "x-1-60s.jpg"), ["1/250", "1/60"]),
        (("a 2s.jpg", "a 0.5s.jpg"), ["2", "0.5"]),
        (("cp_t160.jpg", "cp_t5.jpg", "cp_t80.jpg"), ["1/160", "1/5", "1/80"]),
        (("t1.jpg", "t25.jpg"), ["1", "1/25"]),
        (("0.25s.jpg", "1s.jpg"), ["0.25", "1"]),
        # Seconds or their reciprocals, counts, two forms together, no unit: not to be known.
        (("t0.5.jpg", "t2.5.jpg"), None),
        (("cp_t160s.jpg", "cp_t5s.jpg"), None),
        (("cp_t050.jpg", "cp_t100.jpg"), None),
        (("t1.jpg", "t2.jpg", "t3.jpg"), None),
        (("x_1_2.jpg", "x_1_3.jpg", "x_1_4.jpg"), None),
        (("cp_t160.jpg", "1_40.jpg"), None),
        (("cp_t160.jpg", "0.025s.jpg"), None),
        (("0024.jpg", "0060.jpg"), None),
        (("shot160.jpg", "shot40.jpg"), None),
        (("IMG_1.jpg", "IMG_2.jpg"), None),
        (("2016_08.jpg", "2016_09.jpg"), None),
        (("1_25.jpg", "IMG_2.jpg"), None),
        (("a_1_25.jpg", "b_1_25.jpg"), None),
        (("stack_room_exp_0.jpg", "stack_room_exp_1.jpg"), None),
    ],
)
def test_times_read_from_names(names, times):
    assert times_in_names(names) == times


def test_names_are_believed_only_when_asked(tmp_path):
    paths = shot(tmp_path, names=("cp_t60.png", "cp_t15.png", "cp_t4.png"))
    assert sources(read_bracket(paths)) == ["EXIF"] * 3
    bracket = read_bracket(paths, times_from_names=True)
    assert sources(bracket) == ["name"] * 3
    assert seconds(bracket) == pytest.approx([1 / 60, 1 / 15, 1 / 4], rel=1e-12)
    with pytest.raises(ValueError, match="choose one of the two"):
        read_bracket(paths, times=TIMES, times_from_names=True)
    counted = shot(tmp_path, names=("IMG_1.png", "IMG_2.png", "IMG_3.png"))
    with pytest.raises(NotABracket, match=r"^IMG_1\.png: the names of these photographs give no times; .*cp_t160"):
        read_bracket(counted, times_from_names=True)
    # The first name without a time is the one that is named.
    with pytest.raises(NotABracket, match=r"^IMG_2\.png"):
        seconds_in_names(["1_60.png", "IMG_2.png"])
    alone = shot(tmp_path, names=("cp_t60.png", "x.png", "y.png"), exif=False)[0]
    with pytest.raises(NotABracket, match=r"no exposure time .*give --times-from-names \(1/60 s\)"):
        read_bracket([alone])


def test_a_photograph_without_time_among_others_is_estimated_on_their_scale():
    contrasty = VirtualCamera()  # far from sRGB, which between two reported exposures does not matter
    photographs = list(contrasty.bracket(wide_scene(), [1 / 32, 1 / 16, 1 / 8, 1 / 4]).photographs)
    photographs = [replace(p, exposure=replace(p.exposure, f_number=4.0, iso=200.0)) for p in photographs if p.exposure]
    for place, tolerance in ((1, 0.05), (2, 0.05), (0, 0.25), (3, 0.25)):
        unknown = [replace(p, exposure=None) if i == place else p for i, p in enumerate(photographs)]
        with pytest.warns(
            UserWarning, match=rf"frame_{place}\.jpg: no exposure is known; it is estimated from the other"
        ):
            found = estimated(unknown)[place].exposure
        assert found is not None and (found.f_number, found.iso, found.source) == (4.0, 200.0, "estimated")
        assert abs(np.log2(found.seconds * 2.0 ** (5 - place))) < tolerance
        assert [p.exposure for i, p in enumerate(unknown) if i != place] == [
            p.exposure for i, p in enumerate(photographs) if i != place
        ]


def test_exposures_that_pixels_cannot_show_are_refused():
    white = [Photograph(np.full((40, 40, 3), 255, np.uint8), f"{name}.png") for name in "ab"]
    with pytest.raises(NotABracket, match=r"b\.png: its exposure is unknown.*--times"):
        estimated(white)


def test_a_photograph_alone_without_time_is_refused(tmp_path):
    paths = shot(tmp_path, exif=False)
    with pytest.raises(NotABracket, match=r"a\.png: no exposure time"):
        read_bracket(paths[:1])


def test_the_exposure_table_lists_each_exposure_and_its_source(tmp_path):
    paths = shot(tmp_path)
    table = read_bracket(paths[::-1]).exposure_table
    assert table[0] == FrameFacts(str(paths[0]), 1 / 60, 8.0, 100.0, 0.0, "EXIF")
    assert [(line.name, line.seconds) for line in table] == list(zip(map(str, paths), TIMES, strict=True))
    assert [line.stops for line in table] == pytest.approx([0.0, 2.0, np.log2(15)])


@pytest.mark.parametrize(
    "nominal, steps",
    [
        *[(1 / 60, -6), (1 / 30, -5), (1 / 15, -4), (1 / 8, -3), (1 / 125, -7), (1 / 250, -8), (1 / 500, -9)],
        *[(1 / 1000, -10), (1 / 4000, -12), (1 / 8000, -13), (1, 0), (8, 3), (15, 4), (30, 5)],
        *[(1 / 13, -11 / 3), (1 / 20, -13 / 3), (1 / 25, -14 / 3), (1 / 40, -16 / 3), (1 / 50, -17 / 3)],
        *[(1 / 80, -19 / 3), (1 / 100, -20 / 3), (1 / 160, -22 / 3), (1 / 640, -28 / 3), (1 / 6400, -38 / 3)],
        *[(0.3, -5 / 3), (0.8, -1 / 3), (1.3, 1 / 3), (2.5, 4 / 3), (3.2, 5 / 3), (13, 11 / 3), (20, 13 / 3)],
        *[(1 / 45, -5.5), (1 / 90, -6.5), (1 / 180, -7.5), (1 / 350, -8.5), (1 / 750, -9.5), (1 / 1500, -10.5)],
        *[(0.7, -0.5), (1.5, 0.5)],
    ],
)
def test_marked_shutter_speeds_stand_for_powers_of_two(nominal, steps):
    assert true_shutter(nominal) == pytest.approx(2.0**steps, rel=1e-12)
    assert true_shutter(round(nominal, 6)) == pytest.approx(2.0**steps, rel=1e-12)


@pytest.mark.parametrize("measured", [1 / 64, 1 / 1024, 16.0, 32.0, 1 / 20.5, 1 / 553, 0.0125 * 1.01, 100.0, 1 / 7])
def test_times_that_no_camera_marks_are_left_as_they_are(measured):
    assert true_shutter(measured) == measured


def test_a_mark_of_two_scales_is_decided_by_the_speed_written_beside_it():
    assert true_shutter(1 / 20, 4.321928) == pytest.approx(2 ** (-13 / 3))
    assert true_shutter(1 / 20, 4.5) == pytest.approx(2**-4.5)
    assert true_shutter(6, -2.5) == pytest.approx(2**2.5)


def test_true_powers_are_an_option_of_reading(tmp_path):
    paths = shot(tmp_path)
    assert seconds(read_bracket(paths)) == [1 / 60, 1 / 15, 1 / 4]
    assert seconds(read_bracket(paths, true_powers=True)) == [1 / 64, 1 / 16, 1 / 4]
    assert seconds(read_bracket(paths, times=[1 / 125, 1 / 61, 1 / 30], true_powers=True)) == [1 / 128, 1 / 61, 1 / 32]


def test_the_colour_to_ignore_marks_what_is_outside(tmp_path):
    paths = shot(tmp_path)
    pixels = files.read_photograph(paths[1]).pixels.copy()
    pixels[:, :7] = (0, 0, 255)
    pixels[0, 20] = (0, 1, 255)
    files.write(paths[1], Photograph(pixels, exposure=Exposure(1 / 15, 8.0, 100)))
    bracket = read_bracket(paths, ignore=(0, 0, 255))
    outside = bracket.photographs[1].outside
    assert outside is not None and outside[:, :7].all() and not outside[:, 7:].any()
    assert bracket.photographs[0].outside is None and bracket.photographs[2].outside is None
    with pytest.warns(UserWarning, match="no pixel of the colour 1,2,3 to ignore"):
        read_bracket(paths, ignore=(1, 2, 3))


def test_a_photograph_that_is_there_twice_is_kept_once(tmp_path):
    paths = shot(tmp_path)
    shutil.copy(paths[1], tmp_path / "again.png")
    with pytest.warns(UserWarning, match=r"again\.png: pixel for pixel .*b\.png, so it is left out"):
        bracket = read_bracket([*paths, tmp_path / "again.png"])
    assert [p.name for p in bracket.photographs] == [str(path) for path in paths]


REAL = {
    "arch_full": ("EXIF", 4, 15.0 * 30),
    "garage": ("EXIF", 3, 16.0),
    "ghost_hall": ("EXIF", 3, 100 / 6),
    "ghost_sculpture_garden": ("sidecar", 5, 16.0),
    "handheld_street": ("EXIF", 3, 16.0),
    "memorial": ("sidecar", 16, 2.0**15),
    "room": ("EXIF", 7, 8000.0),
    "window": ("EXIF", 9, 60000.0),
}


@pytest.mark.parametrize("name", REAL)
def test_every_real_set_whose_times_are_known_is_read(shared, name):
    source, count, ratio = REAL[name]
    bracket = real_bracket(shared, name)
    assert sources(bracket) == [source] * count
    assert bracket.exposures[-1] / bracket.exposures[0] == pytest.approx(ratio)
    assert (bracket.photographs[0].outside is not None) == (name == "memorial")


def test_the_real_sets_without_times_are_estimated(shared):
    with pytest.warns(UserWarning, match="only the ratios 1 : .* give the exposure times with --times"):
        lady = read_bracket(expand([shared / "data/brackets/ghost_lady"]))
    assert [p.name[-8:] for p in lady.photographs] == ["Img1.jpg", "Img2.jpg", "Img3.jpg"]
    with pytest.warns(UserWarning, match=r"if they are, give --times-from-names \(1/4, 1/25, 3, 17 s\)"):
        arch = read_bracket(expand([shared / "data/brackets/arch_small"]))
    # The camera's contrast is not sRGB's: its 8.8 stops look like more, but not like twice as many.
    stops = [line.stops for line in arch.exposure_table]
    assert 8.8 < stops[-1] < 13 and sources(arch) == ["estimated"] * 4


def test_a_readme_that_describes_the_photographs_is_no_list(tmp_path):
    paths = shot(tmp_path)
    (tmp_path / "readme.txt").write_text(
        "Directory contents:\n\na.png              background photo used for inserting objects\n"
        "b.png, c.png       mirror ball (exposure times are 1/24s, 1/60s)\n"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sources(read_bracket(paths)) == ["EXIF"] * 3
