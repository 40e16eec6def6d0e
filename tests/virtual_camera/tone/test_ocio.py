"""Display transforms of OpenColorIO: its own numbers pixel for pixel, decoded for our display stage."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from relume.image.colour import decode_srgb, encode_srgb
from relume.image.primaries import REC709
from relume.virtual_camera.protocols import ToneOperator
from relume.virtual_camera.tone.ocio import GREY, Ocio
from relume.virtual_camera.view import View

ocio = pytest.importorskip("PyOpenColorIO", reason="the extra ocio is not installed")

ACES_13 = "ocio://cg-config-v2.2.0_aces-v1.3_ocio-v2.4"
ACES_20 = "ocio://cg-config-v4.0.0_aces-v2.0_ocio-v2.5"
VIEW = View(1000.0)

OLD_CONFIG = """ocio_profile_version: 1
roles:
  default: Linear
  scene_linear: Linear
displays:
  sRGB:
    - !<View> {name: AgX, colorspace: AgX Base}
  BT.1886:
    - !<View> {name: AgX, colorspace: AgX Base}
colorspaces:
  - !<ColorSpace>
    name: Linear
  - !<ColorSpace>
    name: Linear BT.709
  - !<ColorSpace>
    name: AgX Base
    from_reference: !<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}
"""

NEW_CONFIG = """ocio_profile_version: 2
roles:
  default: Linear Rec.709
  scene_linear: Linear Rec.709
  cie_xyz_d65_interchange: Linear CIE-XYZ D65
file_rules:
  - !<Rule> {name: Default, colorspace: default}
displays:
  sRGB:
    - !<View> {name: AgX, view_transform: AgX Base, display_colorspace: sRGB}
view_transforms:
  - !<ViewTransform>
    name: AgX Base
    from_scene_reference: !<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}
display_colorspaces:
  - !<ColorSpace>
    name: Linear CIE-XYZ D65
  - !<ColorSpace>
    name: sRGB
    from_display_reference: !<GroupTransform>
      children:
        - !<MatrixTransform> {matrix: [3.2409699, -1.5373832, -0.4986108, 0, -0.9692436, 1.8759675, 0.0415551, 0,
            0.0556301, -0.2039770, 1.0569715, 0, 0, 0, 0, 1]}
        - !<ExponentWithLinearTransform> {gamma: [2.4, 2.4, 2.4, 1], offset: [0.055, 0.055, 0.055, 0],
            direction: inverse}
colorspaces:
  - !<ColorSpace>
    name: Linear Rec.709
"""
"""With the names of Blender's; its view makes of a colour the CIE XYZ that are its square roots."""


def developed(tone: Ocio, pixel: object) -> np.ndarray:
    """One colour through the whole operator, (3,)."""
    radiance = np.tile(np.asarray(pixel, np.float32), (3, 2, 1))
    shown = tone.display_values(radiance, VIEW, tone.adapt(radiance, VIEW))
    assert shown.shape == radiance.shape and shown.dtype == np.float32
    assert np.array_equal(shown, np.broadcast_to(shown[0, 0], shown.shape))
    return shown[0, 0]


@pytest.fixture
def without_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OCIO", raising=False)


def config_file(folder: Path, text: str = OLD_CONFIG) -> str:
    path = folder / "config.ocio"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize(
    ("config", "pixel", "code"),
    [
        # From PyOpenColorIO 2.6.0's CPUProcessor.applyRGB, colour by colour.
        (ACES_13, (0.18, 0.18, 0.18), (0.355952, 0.355953, 0.355953)),
        (ACES_13, (0.8, 0.05, 0.05), (0.735395, 0.149755, 0.156113)),
        (ACES_20, (0.18, 0.18, 0.18), (0.349188, 0.349188, 0.349188)),
        (ACES_20, (0.8, 0.05, 0.05), (0.723014, 0.168243, 0.172428)),
    ],
)
def test_aces_gives_its_pinned_code_values(config: str, pixel: tuple, code: tuple) -> None:
    assert encode_srgb(developed(Ocio(config, grey=GREY), pixel)) == pytest.approx(code, abs=2e-5)


def test_a_picture_agrees_with_the_library_colour_by_colour() -> None:
    radiance = np.random.default_rng(1).gamma(0.5, 1.0, (130, 7, 3)).astype(np.float32)
    config = ocio.Config.CreateFromFile(ACES_13)
    display = config.getDefaultDisplay()
    transform = ocio.DisplayViewTransform("lin_rec709_srgb", display, config.getDefaultView(display))
    alone = config.getProcessor(transform).getDefaultCPUProcessor()
    expected = np.array([[alone.applyRGB(pixel.tolist()) for pixel in row] for row in radiance])
    before = radiance.copy()
    tone = Ocio(ACES_13, grey=GREY)
    shown = tone.display_values(radiance, VIEW, tone.adapt(radiance, VIEW))
    assert np.array_equal(radiance, before)
    # The display's white and black end what either way of reckoning leaves outside.
    assert encode_srgb(np.clip(shown, 0, 1)) == pytest.approx(np.clip(expected, 0, 1), abs=2e-5)


def test_a_p3_display_is_reported_in_rec_709() -> None:
    red = developed(Ocio(ACES_20, "Display P3 - Display", "Un-tone-mapped", grey=GREY), (0.5, 0.02, 0.02))
    assert red == pytest.approx([0.5, 0.02, 0.02], abs=2e-5)


def test_an_hdr_view_reaches_ten_times_the_white_of_100_nits() -> None:
    tone = Ocio(ACES_20, "Rec.2100-PQ - Display", "ACES 2.0 - HDR 1000 nits (P3 D65)", grey=GREY)
    assert developed(tone, (1e6, 1e6, 1e6)) == pytest.approx([10, 10, 10], rel=1e-4)


def test_the_log_mean_becomes_middle_grey_unless_asked() -> None:
    radiance = np.array([[[40, 40, 40], [90, 90, 90]]], np.float32)
    tone = Ocio(ACES_20)
    assert np.exp(tone.adapt(radiance, VIEW).values) == pytest.approx([60])
    shown = tone.display_values(radiance, VIEW, tone.adapt(np.full_like(radiance, 90), VIEW))
    assert shown[0, 1] == pytest.approx([0.1, 0.1, 0.1], abs=2e-5)  # where ACES 2.0 puts 18 %
    assert np.exp(Ocio(grey=0.25).adapt(radiance, VIEW).values) == pytest.approx([0.25])


def test_a_look_changes_a_colour_beyond_the_gamut(without_variable: None) -> None:
    look = ("ACES 1.3 Reference Gamut Compression",)
    plain, compressed = (developed(Ocio(ACES_13, looks=looks, grey=GREY), (0, 0, 4)) for looks in ((), look))
    assert np.abs(plain - compressed).max() > 1e-3


def test_black_and_what_overflows_stay_finite() -> None:
    assert developed(Ocio(ACES_20), (0, 0, 0)) == pytest.approx([0, 0, 0], abs=1e-7)
    assert developed(Ocio(ACES_20, grey=1e-30), (1e30, 1e30, 1e30)) == pytest.approx([1, 1, 1], abs=1e-4)


def test_an_old_configuration_with_agx_is_decoded_by_its_displays_name(tmp_path: Path) -> None:
    tone = Ocio(config_file(tmp_path), "sRGB", "AgX", grey=GREY)
    assert developed(tone, (0.25, 0.16, 0.04)) == pytest.approx(decode_srgb(np.array([0.5, 0.4, 0.2])), abs=1e-4)
    with pytest.raises(ValueError, match=r'its display "BT.1886" mean; choose an sRGB display'):
        developed(Ocio(tone.config, "BT.1886", "AgX"), (1, 1, 1))


def test_a_new_configuration_with_agx_is_decoded_through_its_display(tmp_path: Path) -> None:
    light = np.linalg.inv(REC709.to_xyz()) @ np.array([0.7, 0.8, 0.9])
    tone = Ocio(config_file(tmp_path, NEW_CONFIG), "sRGB", "AgX", grey=GREY)
    assert developed(tone, np.array([0.7, 0.8, 0.9]) ** 2) == pytest.approx(light, abs=1e-3)


def test_the_environment_names_the_configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OCIO", config_file(tmp_path))
    assert encode_srgb(developed(Ocio(grey=GREY), (0.25, 0.25, 0.25))) == pytest.approx([0.5] * 3, abs=1e-4)
    monkeypatch.setenv("OCIO", "")
    assert developed(Ocio(grey=GREY), (0.18, 0.18, 0.18)) == pytest.approx([0.1, 0.1, 0.1], abs=1e-3)


@pytest.mark.parametrize(
    ("tone", "message"),
    [
        (Ocio("no/such.ocio"), r'cannot use the configuration "no/such.ocio": .* give a config.ocio file'),
        (Ocio("ocio://none"), r'cannot use the configuration "ocio://none"'),
        (Ocio(ACES_13, "CRT"), r'no display "CRT" in the OpenColorIO configuration; it has "sRGB - Display", "Disp'),
        (Ocio(ACES_13, view="AgX"), r'no view "AgX" of "sRGB - Display" .* it has "ACES 1.0 - SDR Video", "Un-ton'),
        (Ocio(ACES_13, looks=("warm",)), r'no look "warm" .* it has "ACES 1.3 Reference Gamut Compression"'),
        (Ocio(ACES_13, view="Raw"), r'the view "Raw" of "sRGB - Display" shows data, not a picture'),
    ],
)
def test_what_is_not_there_is_said_with_what_is(tone: Ocio, message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        developed(tone, (1, 1, 1))
    assert "\n" not in str(caught.value)


def test_a_configuration_without_linear_rec_709_is_refused(tmp_path: Path) -> None:
    path = config_file(tmp_path, OLD_CONFIG.replace("Linear BT.709", "Something"))
    with pytest.raises(
        ValueError, match=r'names no linear Rec. 709 colour space; give one the alias "lin_rec709_srgb"'
    ):
        developed(Ocio(path), (1, 1, 1))


def test_a_broken_configuration_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="cannot use the configuration") as caught:
        developed(Ocio(config_file(tmp_path, "ocio_profile_version: 1\ndisplays: [\n")), (1, 1, 1))
    assert "\n" not in str(caught.value)


def test_a_broken_table_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "broken.cube").write_text("LUT_3D_SIZE x\n")
    text = OLD_CONFIG.replace("!<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}", "!<FileTransform> {src: broken.cube}")
    with pytest.raises(ValueError, match=r'cannot make the view "AgX": .*broken.cube') as caught:
        developed(Ocio(config_file(tmp_path, text), "sRGB", "AgX"), (1, 1, 1))
    assert "\n" not in str(caught.value)


def test_a_missing_package_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PyOpenColorIO", None)
    with pytest.raises(ValueError, match=r'not installed: pip install "relume\[ocio\]"'):
        developed(Ocio(ACES_13), (1, 1, 1))


def test_it_is_a_tone() -> None:
    tone: ToneOperator = Ocio()
    assert tone == Ocio() and hash(tone) == hash(Ocio())
