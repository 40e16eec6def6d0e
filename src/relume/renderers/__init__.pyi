from .change import Change as Change
from .environment_probe import environment as environment
