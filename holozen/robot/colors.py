"""Colours: those that Gazebo knows by name, and those written as numbers."""

from holozen.robot.errors import cut
from holozen.robot.parts import Color
from holozen.robot.source import Source
from holozen.robot.tag import Tag, number

# Names and diffuse colours of Gazebo Classic's media/materials/scripts/gazebo.material, see-through ones with the
# alpha that they are blended with. Pictures are not shown: the last three rows have the colour that lies under theirs.
_NAMES: dict[str, Color] = {
    "Grey": (0.7, 0.7, 0.7, 1.0),
    "DarkGrey": (0.175, 0.175, 0.175, 1.0),
    "White WhiteGlow JointAnchor": (1.0, 1.0, 1.0, 1.0),
    "FlatBlack": (0.1, 0.1, 0.1, 1.0),
    "Black": (0.0, 0.0, 0.0, 1.0),
    "Red RedGlow LightOff": (1.0, 0.0, 0.0, 1.0),
    "RedBright": (0.87, 0.26, 0.07, 1.0),
    "Green GreenGlow LightOn": (0.0, 1.0, 0.0, 1.0),
    "Blue BlueGlow SkyBlue": (0.0, 0.0, 1.0, 1.0),
    "Yellow YellowGlow": (1.0, 1.0, 0.0, 1.0),
    "ZincYellow": (0.9725, 0.9529, 0.2078, 1.0),
    "DarkYellow": (0.7, 0.7, 0.0, 1.0),
    "Purple PurpleGlow": (1.0, 0.0, 1.0, 1.0),
    "Turquoise TurquoiseGlow TurquoiseGlowOutline": (0.0, 1.0, 1.0, 1.0),
    "Orange": (1.0, 0.5088, 0.0468, 1.0),
    "Indigo": (0.33, 0.0, 0.5, 1.0),
    "Gold": (0.8, 0.64869, 0.120759, 1.0),
    "RedTransparent RedTransparentOverlay": (1.0, 0.0, 0.0, 0.5),
    "GreenTransparent GreenTransparentOverlay": (0.0, 1.0, 0.0, 0.5),
    "BlueTransparent BlueTransparentOverlay": (0.0, 0.0, 1.0, 0.5),
    "YellowTransparent": (1.0, 1.0, 0.0, 0.5),
    "GreyTransparent": (0.5, 0.5, 0.5, 0.5),
    "BlackTransparent": (0.0, 0.0, 0.0, 0.5),
    "DarkMagentaTransparent": (0.6, 0.0, 0.6, 0.5),
    "OrangeTransparent": (1.0, 0.44, 0.0, 0.4),
    "OrangeTransparentOverlay": (1.0, 0.5088, 0.0468, 0.8),
    "DarkOrangeTransparentOverlay": (0.6, 0.305, 0.028, 0.8),
    "BlueLaser": (0.0, 0.0, 1.0, 0.4),
    "LightBlueLaser": (0.5, 0.5, 1.0, 0.4),
    "PioneerBody": (1.0, 0.0, 0.0, 1.0),
    "Pioneer2Body": (0.681193, 0.000923, 0.000923, 1.0),
    "WoodPallet Wood Bricks WindowFrame BuildingFrame PaintedWall GreyGradientSky CloudySky": (1.0, 1.0, 1.0, 1.0),
    "WoodFloor CeilingTiled Runway Grass CoM": (0.5, 0.5, 0.5, 1.0),
    "Road Residential Tertiary Pedestrian Footway Motorway Lanes_6 "
    "Trunk Lanes_4 Primary Lanes_2 Secondary Lane_1 Steps": (0.8, 0.8, 0.8, 1.0),
}

GAZEBO: dict[str, Color] = {f"Gazebo/{name}": color for names, color in _NAMES.items() for name in names.split()}
"""Gazebo's name of a material -> its colour."""


def read_color(tag: Tag, words: str, source: Source) -> Color | None:
    """Red, green, blue and maybe alpha, each from 0 to 1, as `words` of `tag`; anything else is warned of."""
    values = [number(word) for word in words.split()]
    known = [value for value in values if value is not None and 0 <= value <= 1]
    if len(values) not in (3, 4) or len(known) != len(values):
        told = "red, green, blue and alpha, each from 0 to 1"
        source.warn(tag, f"has the colour {cut(words)}, which is left out; write {told}")
        return None
    red, green, blue, alpha = (*known, 1.0)[:4]
    return red, green, blue, alpha


def nearest_gazebo(word: str, source: Source) -> str:
    """What a misspelt name of Gazebo's may mean, as a phrase: `Black`, too, stands for `Gazebo/Black`."""
    return source.nearest(word if "/" in word else f"Gazebo/{word}", GAZEBO)
