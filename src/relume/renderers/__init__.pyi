from .environment_probe import environment as environment
from .mitsuba.variant import choose_variant as choose_variant
from .progressive.graceful_shutdown import HardStop as HardStop
from .renderer import Constant as Constant
from .results import Change as Change
