"""Pages in a real browser: headless Chromium, by node and puppeteer-core."""

import contextlib
import functools as ft
import http.server
import json
import os
import shutil
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path


BROWSER = Path(__file__).parent / "browser"
PACKAGES = ("x3dom", "x_ite", "puppeteer-core")


def missing_browser(folder: str | None) -> str | None:
    """What a browser lacks here; None for nothing.

    **Arguments:** `folder`: of npm's packages.
    """
    if not folder:
        return "set CLOUDJAX_NODE_MODULES to a node_modules folder"
    for name in PACKAGES:
        if not (Path(folder) / name).is_dir():
            return f"{folder} lacks the npm package {name}"
    for program in ("node", "chromium"):
        if shutil.which(program) is None:
            return f"there is no {program}"
    return None


def look(
    modules: Path,
    page: str | Path,
    picture: Path,
    view: int,
    size: tuple[int, int],
    pause_s: float = 4.0,
) -> dict:
    """What a page says, seconds and memory; its picture is written."""
    command = "node", BROWSER / "look.js", page, picture, view, *size
    done = subprocess.run(
        list(map(str, command)),
        env=os.environ
        | {"NODE_PATH": str(modules), "PAUSE": str(round(1000 * pause_s))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@contextlib.contextmanager
def served(folder: Path, modules: Path) -> Iterator[str]:
    """The address of a folder with X_ITE in it, which reads from servers only."""
    link = folder / "x_ite"
    if not link.exists():
        link.symlink_to(modules / "x_ite" / "dist")
    handler = ft.partial(_Silent, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


class _Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format, *args):
        pass


def x_ite_page(folder: Path, scene: str) -> str:
    """The name of a page in a folder that shows a scene of it in X_ITE."""
    text = (BROWSER / "x_ite.html").read_text().replace("SCENE", scene)
    (folder / "x_ite.html").write_text(text)
    return "x_ite.html"
