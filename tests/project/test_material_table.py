"""The table of a material: presets by name, changes on top, and one line for what cannot be."""

import numpy as np
import pytest
from pydantic import ValidationError

from measured_tables import write_merl
from relume.errors import UnreadableFile
from relume.project.mesh_tables import MaterialTable
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.measured import MeasuredBRDF

TIN = Material((0.5, 0.5, 0.5), metallic=1.0, roughness=0.4, name="tin")


def test_an_empty_table_changes_nothing():
    found = MaterialTable().apply(TIN)
    assert (found.base_color, found.metallic, found.roughness, found.name) == ((0.5, 0.5, 0.5), 1, 0.4, "tin")


def test_changes_go_onto_the_meshs_own_material():
    found = MaterialTable(roughness=0.1, clearcoat=1.0, emission=(5, 0, 0)).apply(TIN)
    assert (found.roughness, found.metallic, found.clearcoat, found.emission) == (0.1, 1, 1, (5, 0, 0))


def test_a_preset_takes_the_place_of_the_meshs_own():
    gold = MaterialTable(preset="gold", roughness=0.3).apply(TIN)
    np.testing.assert_allclose(gold.base_color, (1, 0.7156935, 0.3371636), atol=1e-6)
    assert (gold.roughness, gold.name) == (0.3, "gold")
    assert isinstance(MaterialTable(preset="rolled_brass").apply(Diffuse((0, 0, 0))), Ward)


def test_a_field_that_the_preset_has_not_is_reported():
    with pytest.raises(
        ValueError, match="roughness: a Ward surface has none; it has alpha_x, alpha_y, crossed, crossing, diffuse"
    ):
        MaterialTable(preset="rolled_brass", roughness=0.3).apply(TIN)
    with pytest.raises(ValueError, match="alpha_x: a glTF material has none"):
        MaterialTable(alpha_x=0.3).apply(TIN)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"preset": "glod"}, "no preset 'glod'; the presets are aluminium"),
        ({"roughness": 2}, "less than or equal to 1"),
        ({"colour": [1, 1, 1]}, "Extra inputs"),
        ({"emission": [1, -1, 0]}, "greater than or equal to 0"),
        ({"scattering_distance": [0, 1, 1]}, "greater than 0"),
    ],
)
def test_what_cannot_be_is_refused(table, words):
    with pytest.raises(ValidationError, match=words):
        MaterialTable.model_validate(table)


def test_a_measured_surface_takes_the_place_of_the_meshs_own(tmp_path):
    values = np.full((90, 90, 180, 3), 0.1)
    write_merl(tmp_path / "felt.binary", values)
    felt = MaterialTable(file="felt.binary", scale=2.0).apply(TIN, tmp_path)
    assert isinstance(felt, MeasuredBRDF) and felt.name == "felt"
    np.testing.assert_allclose(felt.values[0, 0, 0], 0.2, rtol=1e-6)
    fit = MaterialTable(preset="merl/teflon", scale=2.0, ior=1.4).apply(TIN)
    assert fit.diffuse[0] == pytest.approx(2 * 0.321152) and fit.ior == 1.4
    assert fit.strength[0] == pytest.approx(2 * 1.78772)
    for table, line in (
        ({"file": "felt.binary", "roughness": 0.5}, "roughness: a measured surface has none"),
        ({"preset": "merl/teflon", "roughness": 0.5}, "roughness: a fit to a measured surface has none"),
        ({"scale": 2.0}, "scale: is of measured surfaces"),
    ):
        with pytest.raises(ValueError, match=line):
            MaterialTable(**table).apply(TIN, tmp_path)
    with pytest.raises(UnreadableFile, match=r"felt\.binary: no such file"):
        MaterialTable(file="felt.binary").apply(TIN, tmp_path / "elsewhere")


def test_scratches_are_turned_by_degrees():
    made = MaterialTable(preset="brushed_steel", crossed=0.4, rotation=30.0, crossing=60.0).apply(TIN)
    assert (made.crossed, made.rotation, made.crossing) == pytest.approx((0.4, np.pi / 6, np.pi / 3))
