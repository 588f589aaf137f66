"""Places of parts, axes of joints and directions: what is refused, with both points."""

import numpy as np
import pytest

import dovetail
from dovetail.description.placed_parts import PlaceSection

STEEL = {"young": 210e9, "density": 7850.0}
BAR = {"length": 0.2, "width": 0.02, "height": 0.01, "elements": 2}


def two_bars(place=None, joint=None, **changes):
    """Return an upright bar and one upon it."""
    return {
        "dovetail": 1,
        "name": "two bars",
        "frequency": [100.0, 200.0],
        "substructures": {
            "post": {"model": "spatial_beam", "material": STEEL, "sections": [BAR], "place": {"along": "z"}},
            "arm": {
                "model": "spatial_beam",
                "material": STEEL,
                "sections": [BAR],
                "place": place or {"origin": [0.0, 0.0, 0.2], "along": "x", "across": "z"},
            },
        },
        "joints": {
            "corner": {
                "model": "bushing",
                "connect": {"a": {"to": "post", "at": 0.2}, "b": {"to": "arm", "at": 0.0}},
                **(joint or {}),
            }
        },
        "response": {"at": "arm", "position": 0.2, "direction": "z", **changes},
    }


def problems(description):
    with pytest.raises(dovetail.DovetailError) as error:
        dovetail.load(description)
    return [(fault.where.rpartition("  ")[2], fault.problem) for fault in error.value.faults]


def test_parts_that_meet_are_accepted():
    assert dovetail.load(two_bars()).frf().shape == (2,)


@pytest.mark.parametrize(
    ("place", "point", "distance"),
    [
        ({"origin": [0.0, 0.0, 0.21], "along": "x", "across": "z"}, "(0, 0, 210) mm", "10 mm"),
        ({"origin": [0.2, 0.0, 0.2], "along": "x", "across": "z"}, "(200, 0, 200) mm", "200 mm"),
        ({"along": "x", "across": "z"}, "(0, 0, 0) mm", "200 mm"),
        ({"origin": [0.0, 0.001, 0.2], "along": "-x", "across": "z"}, "(0, 1, 200) mm", "1 mm"),
    ],
)
def test_facing_nodes_at_different_points_are_refused_with_both(place, point, distance):
    ((where, problem),) = problems(two_bars(place))
    assert where == "joints.corner.connect.b.at"
    assert f"of 'arm' at {point} faces that of 'post' at (0, 0, 200) mm" in problem
    assert f"it is {distance} away" in problem


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ({"along": "x"}, "say with 'across' where the part's x points"),
        ({"along": "x", "across": [1, 1, 0]}, "are not perpendicular"),
        ({"across": "x"}, "'across' needs 'along'"),
        ({"along": [0, 0, 0], "across": "z"}, "'along' has no length"),
        ({"along": "q"}, "'q' is not a direction"),
        ({"rotate": [{"about": "z", "angle": "90 deg"}], "along": "x"}, "either 'rotate', or"),
        ({"origin": [0.0, 0.0]}, ""),
        ({"orign": [0.0, 0.0, 0.0]}, "orign"),
    ],
)
def test_a_place_that_says_too_little_or_too_much_is_refused(place, said):
    found = problems(two_bars(place))
    assert len(found) == 1
    assert found[0][0].startswith("substructures.arm.place")
    assert said in found[0][1]


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ({"x": "x"}, "two axes are needed"),
        ({"x": "x", "y": [1, 1, 0]}, "are not perpendicular"),
        ({"x": "x", "y": "y", "z": "z"}, "the third follows"),
        ({}, "give either"),
        ({"x": [0, 0, 0], "y": "y"}, "no length"),
    ],
)
def test_axes_that_say_too_little_or_too_much_are_refused(axes, said):
    found = problems(two_bars(joint={"axes": axes}))
    assert len(found) == 1
    assert said in found[0][1]


def test_a_ball_joint_holds_the_same_whatever_its_axes():
    plain, turned = (
        dovetail.load(two_bars(joint={"model": "rigid", "direction": ["x", "y", "z"], **axes})).frf()
        for axes in ({}, {"axes": {"z": [1, 1, 0], "x": "z"}})
    )
    np.testing.assert_allclose(turned, plain, rtol=1e-12)


def test_a_joint_with_axes_of_its_own_can_be_identified():
    """All that names the joint's model, such as the record of where it comes from, sees that of the description."""
    description = two_bars(joint={"axes": {"x": [1, 0, 1], "y": "y"}})
    description["frequency"] = {"start": 50.0, "stop": 1000.0, "lines": 60}
    parameters = {f"{letter}_{each}": {"value": 1.0} for letter in "c" for each in ("x", "y", "z", "rx", "ry", "rz")}
    parameters |= {f"k_{each}": {"value": 1e6} for each in ("y", "z", "rx", "ry", "rz")}
    description["joints"]["corner"]["parameters"] = parameters
    assembly = dovetail.load(description)
    measured = dovetail.noisy_frf(assembly.simulate({"k_x": 1e7}), 0.01, 0)
    result = dovetail.identify(assembly, measured, method="refined")
    assert result.parameters["k_x"].value == pytest.approx(1e7, rel=0.2)
    assert result.provenance["components"]["joint bushing"].startswith("dovetail-frf")


def test_a_direction_in_which_a_node_does_not_move_is_refused():
    planar = two_bars()
    planar["substructures"]["arm"] = {"model": "timoshenko_beam", "material": STEEL, "sections": [BAR]}
    planar["substructures"]["post"] = {**planar["substructures"]["arm"]}
    planar["joints"]["corner"]["connect"]["a"]["at"] = 0.0
    found = problems(planar)
    assert "but this node of 'post' does not move in y, z, rx, ry" in found[0][1]
    assert any("does not move in the direction z there" in problem for _, problem in found)


def test_a_planar_part_can_be_turned_by_right_angles_only():
    description = two_bars()
    beam = {"model": "timoshenko_beam", "material": STEEL, "sections": [BAR]}
    description["substructures"]["post"] = {**beam, "place": {"along": [0, 1, 1]}}
    found = problems(description)
    assert "so turned these are not along axes of the assembly" in found[0][1]
    description["substructures"]["post"]["place"] = {"along": "z"}
    description["joints"]["corner"]["directions"] = ["x", "ry"]
    description["response"] = {"at": "post", "position": 0.0, "direction": "ry"}
    assert np.isfinite(dovetail.load(description).frf()).all()


def test_a_rotation_by_steps_is_that_along_and_across():
    steps = PlaceSection.model_validate({"rotate": [{"about": "z", "angle": "90 deg"}, {"about": "x", "angle": 0.0}]})
    named = PlaceSection.model_validate({"along": "x", "across": "y"})
    np.testing.assert_array_equal(steps.rotation, named.rotation)


@pytest.mark.parametrize("position", [0.1, "n2", [0.1, 0.0, 0.2]])
def test_a_node_is_named_by_position_label_or_coordinates(position):
    by_position = dovetail.load(two_bars(position=0.1)).frf()
    np.testing.assert_array_equal(dovetail.load(two_bars(position=position)).frf(), by_position)


def test_coordinates_without_a_node_are_refused_with_the_nearest():
    ((where, problem),) = problems(two_bars(position=[0.1, 0.01, 0.2]))
    assert where == "response.position"
    assert problem == "substructure 'arm' has no node at (100, 10, 200) mm."


def test_an_origin_with_too_few_coordinates_is_one_fault():
    ((where, problem),) = problems(two_bars({"origin": [0.1], "along": "x", "across": "z"}))
    assert (where, problem) == ("substructures.arm.place.origin", "'place.origin' of 'arm' has 1 of 3 elements.")


def test_a_position_on_a_body_whose_nodes_have_none_names_the_nodes():
    description = two_bars()
    body = {
        "model": "rigid_body",
        "mass": 1.0,
        "inertia": [1e-3] * 3,
        "nodes": {"top": [0, 0, 0.1], "tip": [0, 0, 0.2]},
    }
    description["substructures"]["body"] = body
    description["response"] |= {"at": "body", "position": 0.1}
    with pytest.raises(dovetail.DovetailError) as error:
        dovetail.load(description)
    fault = next(fault for fault in error.value.faults if "has no node" in fault.problem)
    assert (fault.accepted, fault.remedy) == ("top, tip, or coordinates", "")
