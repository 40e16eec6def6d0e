from .environment_probe import environment as environment
from .results import Change as Change
