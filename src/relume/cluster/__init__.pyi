from .claims import held as held
from .connection import Cluster as Cluster
from .connection import connect as connect
from .one_command import runs_one_command as runs_one_command
from .tasks import run_tasks as run_tasks
