"""The rows of docs/accuracy/extremes.md: what is extreme, and what happens there.

Each row is a function that looks, requires what physics says, and returns a sentence
with what it measured. The tests run them all; `python -m tools.make_extremes` writes
the table.
"""

# In the order of the table.
# isort: off
from . import clouds as clouds
from . import views as views
from . import winds as winds
from . import shells as shells
from . import pixels as pixels
from . import values as values
from . import numbers as numbers
from .rows import ROWS as ROWS
