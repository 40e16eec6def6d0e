"""The table of a material: presets by name, changes on top, and one line for what cannot be."""

import numpy as np
import pytest
from pydantic import ValidationError

from measured_tables import write_merl
from relume.errors import UnreadableFile
from relume.project.mesh_tables import MaterialTable
from relume.project.shot_file.local_table import LocalTable
from relume.scene.materials.glasses import GLASSES, Cauchy, Sellmeier
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.metals import METALS

TIN = Material((0.5, 0.5, 0.5), metallic=1.0, roughness=0.4, name="tin")


def test_an_empty_table_changes_nothing():
    found = MaterialTable().apply(TIN)
    assert (found.base_color, found.metallic, found.roughness, found.name) == ((0.5, 0.5, 0.5), 1, 0.4, "tin")


def test_changes_go_onto_the_meshs_own_material():
    found = MaterialTable(roughness=0.1, clearcoat=1.0, emission=(5, 0, 0)).apply(TIN)
    assert (found.roughness, found.metallic, found.clearcoat, found.emission) == (0.1, 1, 1, (5, 0, 0))


def test_a_preset_takes_the_place_of_the_meshs_own():
    gold = MaterialTable(preset="gold", roughness=0.3).apply(TIN)
    np.testing.assert_allclose(gold.base_color, (1, 0.7282, 0.3647), atol=1e-4)
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


@pytest.mark.parametrize("table", [{"glass": "SF11"}, {"preset": "flint_glass"}])
def test_glass_by_name_says_the_index_and_the_dispersion(table):
    found = MaterialTable.model_validate({"transmission": 1, "roughness": 0} | table).apply(TIN)
    assert found.ior == pytest.approx(1.78472, abs=1e-5) and found.dispersion == pytest.approx(20 / 25.76, abs=1e-3)
    assert found.glass is GLASSES["SF11"]


def test_glass_by_coefficients_is_that_of_the_name():
    water = GLASSES["water"]
    assert isinstance(water, Sellmeier)
    table = {"transmission": 1, "sellmeier": {"B": list(water.B), "C": list(water.C)}}
    assert MaterialTable.model_validate(table).apply(Material(ior=1.7)).glass == water
    ice = MaterialTable.model_validate({"cauchy": {"A": 1.3, "B": 0.004}}).apply(Material())
    assert ice.glass == Cauchy(1.3, 0.004) and ice.ior == pytest.approx(1.3 + 0.004 / 0.5875618**2)


def test_a_changed_index_takes_the_place_of_a_presets_glass():
    found = MaterialTable(preset="diamond", ior=1.5).apply(TIN)
    assert found.glass is None and found.ior == 1.5 and found.dispersion == pytest.approx(20 / 55.3, abs=1e-3)


def test_metals_by_symbol_and_by_name():
    by_symbol, by_name = (MaterialTable(metal=name, roughness=0.3).apply(TIN) for name in ("Au", "gold"))
    assert by_symbol.metal is by_name.metal is METALS["Au"]
    assert (by_symbol.metallic, by_symbol.roughness, by_symbol.base_color) == (1, 0.3, METALS["Au"].base_color)
    painted = MaterialTable(preset="gold", base_color=(0.1, 0.2, 0.3)).apply(TIN)
    assert painted.metal is None and painted.base_color == (0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"glass": "SF99"}, "no glass 'SF99'; there are N-BK7"),
        ({"metal": "Xx"}, "no metal 'Xx'; there are Ag"),
        ({"glass": "SF11", "ior": 1.5}, "has glass and ior, which say the same; give one of them"),
        ({"glass": "SF11", "cauchy": {"A": 1.5, "B": 0.004}}, "has glass and cauchy"),
        ({"metal": "Au", "base_color": [1, 1, 1]}, "has metal and base_color"),
        ({"sellmeier": {"B": [1.0], "C": [0.1, 0.2]}}, "1 B and 2 C"),
        ({"cauchy": {"A": 0.5, "B": 0.0}}, "no index of refraction from 1 to 10"),
    ],
)
def test_two_that_say_the_same_and_unknown_names_are_refused(table, words):
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
            MaterialTable.model_validate(table).apply(TIN, tmp_path)
    with pytest.raises(UnreadableFile, match=r"felt\.binary: no such file"):
        MaterialTable(file="felt.binary").apply(TIN, tmp_path / "elsewhere")


def test_scratches_are_turned_by_degrees():
    made = MaterialTable(preset="brushed_steel", crossed=0.4, rotation=30.0, crossing=60.0).apply(TIN)
    assert (made.crossed, made.rotation, made.crossing) == pytest.approx((0.4, np.pi / 6, np.pi / 3))


def test_one_number_is_grey_in_shots_too():
    milk = MaterialTable.model_validate({"preset": "milk", "scattering_distance": 0.01, "scattering_albedo": 0.5})
    assert milk.scattering_distance == (0.01,) * 3 and milk.scattering_albedo == (0.5,) * 3
    table = LocalTable.model_validate({"shape": "plane", "size": [1, 1], "reflectance": 0.3})
    assert table.reflectance == (0.3, 0.3, 0.3)
    assert LocalTable.model_validate({"shape": "plane", "size": [1, 1]}).reflectance == "recover"
    for wrong in (1.5, True, "recovered"):
        with pytest.raises(ValidationError):
            LocalTable.model_validate({"shape": "plane", "size": [1, 1], "reflectance": wrong})
