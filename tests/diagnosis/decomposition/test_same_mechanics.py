"""What no measurement of the tool tells apart has one name."""

from beamstiff import load_robot
from beamstiff.diagnosis.decomposition.same_mechanics import same_mechanics


def test_behind_the_last_joint_and_in_front_of_the_first_there_is_one_mechanics_each() -> None:
    groups = same_mechanics(load_robot("kr240-2"))
    end = groups["tool-compliance:null"]
    assert end[0] == "tool-compliance:null"
    assert {"bearing-tilt:q6", "link-bending:link5"} <= set(end)
    ground = groups["base-compliance:null"]
    assert ground[0] == "base-compliance:null"
    assert set(ground) == {"base-compliance:null", "bearing-tilt:q1", "link-bending:link0"}
    assert groups["bearing-tilt:q6"] == end
    assert groups["link-bending:link0"] == ground


def test_a_link_between_two_joints_is_a_mechanics_of_its_own() -> None:
    groups = same_mechanics(load_robot("kr240-2"))
    assert not {f"link-bending:link{at}" for at in (1, 2, 3)} & set(groups)
