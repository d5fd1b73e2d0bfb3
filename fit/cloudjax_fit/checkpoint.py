"""How far a fit has come, in a file that is whole after every step."""

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import equinox as eqx

from cloudjax_data import DataError
from cloudjax_data.whole_files import whole

from .solver import Progress
from .versions import versions


NAME = "checkpoint.eqx"


@dataclass(frozen=True)
class Checkpoint:
    """A `Checkpoint` keeps how far a fit has come from each of its starts.

    A line of JSON, then the arrays of the solver as equinox writes them.

    **Fields:**

    - `path`: of the file; None keeps nothing.
    - `asked`: a digest of what the fit was asked to do (`asked_of`). What another fit
      has kept there is not gone on from.
    """

    path: Path | None = None
    asked: str = ""

    def read(self, begin: Callable[[], Progress]) -> list[Progress]:
        """Read the progress from each start that was begun, none without a file.

        **Arguments:** `begin` makes progress of the same structure.

        **Raises:** `DataError` if the file is damaged.
        """
        if self.path is None or not self.path.exists():
            return []
        try:
            with self.path.open("rb") as file:
                head = json.loads(file.readline())
                if head["of"] != self._of:
                    return []
                return [_read(file, facts, begin()) for facts in head["starts"]]
        except (ValueError, KeyError, TypeError, RuntimeError, EOFError) as error:
            raise DataError(
                f"{self.path} is damaged: remove it, and the fit begins anew."
            ) from error

    def write(self, starts: Sequence[Progress]) -> None:
        """Replace what was kept, all at once.

        **Raises:** `DataError` if the disk does not take it.
        """
        if self.path is None:
            return
        facts = [
            {"losses": p.losses, "loss": p.loss, "ends": p.ends, "sound": p.sound}
            for p in starts
        ]
        head = json.dumps({"of": self._of, "starts": facts})
        try:
            with whole(self.path) as aside, aside.open("wb") as file:
                file.write(head.encode() + b"\n")
                for each in starts:
                    eqx.tree_serialise_leaves(file, (each.z, each.state))
        except OSError as error:
            raise DataError(
                f"{self.path} cannot be written ({error.strerror or error}): free some "
                "space or choose another folder for the output."
            ) from error

    def remove(self) -> None:
        """Remove what was kept."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    @property
    def _of(self) -> dict[str, str]:
        # Other versions may have other arrays, or other numbers.
        return {"asked": self.asked} | versions()


def checkpoint_in(folder: str | os.PathLike[str], asked: str) -> Checkpoint:
    """Return the checkpoint of the fit whose results go into a folder."""
    return Checkpoint(Path(folder) / NAME, asked)


def _read(file: BinaryIO, facts: dict, like: Progress) -> Progress:
    z, state = eqx.tree_deserialise_leaves(file, (like.z, like.state))
    losses = tuple(facts["losses"])
    return Progress(z, state, losses, facts["loss"], facts["ends"], facts["sound"])
