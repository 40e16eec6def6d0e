from .claims import held as held
from .connection import Cluster as Cluster
from .connection import connect as connect
from .tasks import run_tasks as run_tasks
