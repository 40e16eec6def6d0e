"""A field written for RTI viewers: pictures and their .lp, and fits of what the pictures show."""

import warnings

import numpy as np
import pytest

from relume.errors import OutputNotWritten
from relume.image import files
from relume.image.colour import encode_srgb
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.lightstage.rti.export import RTIForm, export_rti
from relume.lightstage.rti.ptm import fit_rgb
from relume.scene.cameras.camera import Camera
from written_by_stages import read_hsh, read_ptm

LIGHTS = StageLights.towards(even_directions(80))
CAMERA = Camera.looking_at(np.array([3.0, 0, 0]), np.zeros(3), width=9, height=7, focal_length=20.0)
BEFORE = LIGHTS.directions[:, 0] > 0.02


def matte(camera: Camera | None = CAMERA) -> Pictures:
    """Matte pixels that lean a little, so that no light before the camera leaves any in its own shadow."""
    lean = np.stack(np.meshgrid(np.linspace(-0.2, 0.2, 9), np.linspace(0.2, -0.2, 7)), axis=-1)
    normals = np.concatenate([lean, np.ones((7, 9, 1))], axis=-1)
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    towards = LIGHTS.directions if camera is None else LIGHTS.directions @ camera.rotation
    shading = np.maximum(np.einsum("hwk,nk->nhw", normals, towards), 0)
    return Pictures((shading[..., None] * [0.2, 0.1, 0.05]).astype(np.float32), LIGHTS, camera)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rti") / "new" / "dome"
    with pytest.warns(UserWarning, match="lights stand behind the subject"):
        return export_rti(matte(), folder, RTIForm(pictures="png", ptm="RGB", hsh=3, exposure=4.0), "dome"), folder


def test_lights_behind_the_subject_are_left_out_by_name(written):
    result, _ = written
    assert result.lights == BEFORE.sum() and set(result.left_out) == {str(i) for i in np.flatnonzero(~BEFORE)}


def test_the_lp_names_every_picture_with_its_light_in_the_cameras_frame(written):
    result, folder = written
    lines = (folder / "dome.lp").read_text().splitlines()
    assert lines[0] == str(BEFORE.sum()) and len(lines) == BEFORE.sum() + 1
    names = [line.split()[0] for line in lines[1:]]
    directions = np.array([[float(word) for word in line.split()[1:]] for line in lines[1:]])
    # From +X: the camera's right is −Z, its z is +X.
    x, y, z = LIGHTS.directions[BEFORE].T
    np.testing.assert_allclose(directions, np.stack([-z, y, x], axis=1), atol=1e-6)
    assert names[:2] == ["dome_001.png", "dome_002.png"] and all((folder / name).is_file() for name in names)
    assert [file.name for file in result.files] == ["dome.ptm", "dome.rti", "dome.lp"]


def test_pictures_are_the_field_exposed_and_encoded(written):
    _, folder = written
    first = int(np.flatnonzero(BEFORE)[0])
    codes = np.rint(encode_srgb(matte().values[first] * 4) * 255)
    np.testing.assert_array_equal(files.read_photograph(folder / "dome_001.png").pixels, codes)


def test_the_fits_show_what_the_pictures_show(written):
    result, folder = written
    towards = LIGHTS.directions[BEFORE] @ CAMERA.rotation
    pictures = encode_srgb(matte().values[BEFORE] * 4)
    for fit, said, highest in (
        (read_ptm(folder / "dome.ptm"), result.ptm_error, 0.09),
        (read_hsh(folder / "dome.rti"), result.hsh_error, 0.025),
    ):
        shown = np.clip([fit.lit_from(direction) for direction in towards], 0, 1)
        error = float(np.sqrt(np.mean((shown - pictures) ** 2)))
        assert said == pytest.approx(error, rel=0.1, abs=1e-3) and error < highest


def test_each_light_counts_by_its_solid_angle(tmp_path):
    # Lights that crowd to one side, as a grid's do at its poles.
    directions = LIGHTS.directions[LIGHTS.directions[:, 2] > 0.1]
    crowd = directions[directions[:, 0] > 0.5][:, None] + np.random.default_rng(2).normal(0, 0.02, (1, 6, 3))
    lights = StageLights.towards(np.concatenate([directions, crowd.reshape(-1, 3)]))
    values = np.random.default_rng(3).uniform(0, 1, (len(lights), 4, 4, 3)).astype(np.float32)
    export_rti(Pictures(values, lights), tmp_path, RTIForm(None, "RGB", None, exposure=1.0))
    expected = fit_rgb(encode_srgb(values), lights.directions, lights.solid_angles)
    found = read_ptm(tmp_path / "stage.ptm")
    np.testing.assert_allclose(found.coefficients, expected.coefficients, atol=0.01)
    alike = fit_rgb(encode_srgb(values), lights.directions)
    assert np.abs(found.coefficients - alike.coefficients).max() > 0.05


def test_rows_in_blocks_make_the_same_files(written, tmp_path, monkeypatch):
    result, folder = written
    monkeypatch.setattr("relume.lightstage.rti.export._VALUES", 80 * 9 * 3 * 2)
    with pytest.warns(UserWarning, match="left out"):
        again = export_rti(matte(), tmp_path, RTIForm(pictures=None, ptm="RGB", hsh=3, exposure=4.0), "dome")
    assert (tmp_path / "dome.ptm").read_bytes() == (folder / "dome.ptm").read_bytes()
    assert (tmp_path / "dome.rti").read_bytes() == (folder / "dome.rti").read_bytes()
    assert again.ptm_error == pytest.approx(result.ptm_error)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["dome.ptm", "dome.rti"]


def test_the_exposure_brings_nearly_all_below_white(tmp_path):
    with pytest.warns(UserWarning):
        result = export_rti(matte(), tmp_path, RTIForm(pictures=None, hsh=None))
    brightest = matte().values[BEFORE].max(axis=(0, 3))
    assert result.exposure == pytest.approx(1 / np.quantile(brightest, 0.95)) and result.hsh_error is None
    assert 0 < result.clipped < 0.02 and read_ptm(tmp_path / "stage.ptm").colour is not None


def test_values_above_white_are_reported(tmp_path):
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        result = export_rti(matte(), tmp_path, RTIForm(pictures=None, hsh=None, exposure=50.0))
    assert result.clipped > 0.3 and any("above white at exposure 50" in str(each.message) for each in said)


def test_wrong_calls_are_refused(tmp_path):
    for make in (lambda: RTIForm(pictures="gif"), lambda: RTIForm(hsh=4), lambda: RTIForm(exposure=0.0)):
        with pytest.raises(ValueError, match="expected"):
            make()
    with pytest.raises(ValueError, match="nothing to write"):
        RTIForm(None, None, None)
    with pytest.raises(ValueError, match="one word without a path"):
        export_rti(matte(), tmp_path, name="my stage")
    dark = Pictures(np.zeros((80, 7, 9, 3), np.float32), LIGHTS, CAMERA)
    with pytest.raises(ValueError, match="black under every light"):
        export_rti(dark, tmp_path)
    (tmp_path / "taken").write_text("")
    with pytest.raises(OutputNotWritten, match="cannot be made"):
        export_rti(matte(), tmp_path / "taken" / "deeper")
