"""The rows of docs/accuracy/extremes.md: what is extreme, and what happens there.

Each row is a function that looks, requires what physics says, and returns a sentence
with what it measured. The tests run them all; `python -m tools.make_extremes` writes
the table.
"""

# isort: off: as the table has them.
from . import clouds as clouds
from . import numbers as numbers
from . import pixels as pixels
from . import shells as shells
from . import values as values
from . import views as views
from . import winds as winds
from .rows import ROWS as ROWS
