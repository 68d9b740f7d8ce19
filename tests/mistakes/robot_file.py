"""Mistakes in a URDF: a text is the file, the answer that of `Scene.add_robot`."""

from arms import TURN_AND_LIFT
from mistakes.mistake import Mistake


def urdf(old, new):
    """The file of the arm with one line changed."""
    assert old in TURN_AND_LIFT
    return TURN_AND_LIFT.replace(old, new)


LIMIT = 'lower="0.1" upper="2" effort="1" velocity="1"'
DEGREES = LIMIT.replace('"2"', '"120"').replace("0.1", "-120")

ROBOT_FILE = {
    "degrees of limits": Mistake(
        *("[-120, 120] rad", "joint 'turn' in line 8", "give radians: [-2.094, 2.094]"),
        urdf(LIMIT, DEGREES),
        logged=True,
    ),
    "millimetres of a link": Mistake(
        *("300 m", "robot 'a': link 'base'", "give metres: 0.3"),
        urdf('radius="0.3"', 'radius="300"'),
        logged=True,
    ),
    "millimetres of a frame": Mistake(
        *("500 m", "robot 'a': link 'rod'", "give metres: 0.5"),
        urdf('xyz="0.5 0 0"', 'xyz="500 0 0"'),
        logged=True,
    ),
    "NaN": Mistake(
        *('is "nan"', "'r.urdf' line 9: <limit> lower", "it must be a finite number"),
        urdf(LIMIT, LIMIT.replace("0.1", "nan")),
    ),
    "limits exchanged": Mistake(
        *("limit 3.0", "'r.urdf' line 9: joint 'turn'", "above its upper 2.0"),
        urdf(LIMIT, LIMIT.replace("0.1", "3")),
    ),
    "no limits": Mistake(
        *("is revolute", "'r.urdf' line 8: joint 'turn'", "has no <limit lower upper>"),
        urdf(f"<limit {LIMIT}/>", ""),
    ),
    "another link": Mistake(
        *("parent link 'bse'", "line 8: joint 'turn'", "did you mean 'base'?"),
        urdf('<parent link="base"/>', '<parent link="bse"/>'),
    ),
    "a negative radius": Mistake(
        *('is "-0.3"', "'r.urdf' line 3: <sphere> radius", "it must be > 0"),
        urdf('radius="0.3"', 'radius="-0.3"'),
    ),
    "text for a number": Mistake(
        *('is "half"', "line 9: <limit> upper", "it must be a finite number"),
        urdf('upper="2"', 'upper="half"'),
    ),
    "two numbers of three": Mistake(
        *('is "0 1.5"', "line 2: <origin> xyz", "it must be 3 finite numbers"),
        urdf('xyz="0 1.5 0"', 'xyz="0 1.5"'),
    ),
    "a tag that stays open": Mistake(
        *("is not XML", "'r.urdf'", "Premature end of data in tag robot"),
        urdf("</robot>", ""),
    ),
}
