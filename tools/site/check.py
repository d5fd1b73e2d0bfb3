"""Check that the built site loads nothing from other hosts: check.py FOLDER.

Links that a reader may follow are allowed; scripts, styles, fonts, images and frames
are not. (The theme's own script knows two addresses from which it would load a diagram
library and a replacement for old browsers; no page here asks for either.)
"""

import re
import sys
from pathlib import Path


HOST = r"(?:https?:)?//"
LOADED = (
    re.compile(rf'<(?:script|img|iframe|source|video)\b[^>]*?\ssrc="?{HOST}[^">\s]+'),
    re.compile(
        r'<link\b(?=[^>]*\brel="?(?:stylesheet|preload|preconnect|icon|manifest))'
        rf'[^>]*?\shref="?{HOST}[^">\s]+'
    ),
    re.compile(rf'url\(\s*["\']?{HOST}[^)]+'),
    re.compile(rf'@import\s*["\']{HOST}[^"\']+'),
    re.compile(r'<\w+\b[^>]*\bclass="?[^">]*\bmermaid\b'),
)


def foreign(text: str) -> list[str]:
    """Return what a page or a style sheet would load from other hosts."""
    return [match[0] for pattern in LOADED for match in pattern.finditer(text)]


def main(folder: Path) -> int:
    """Print what is loaded from elsewhere, and count such places."""
    pages = [p for p in sorted(folder.rglob("*")) if p.suffix in (".html", ".css")]
    if not pages:
        print(f"There is no page in {folder}: build the site first.")
        return 1
    found = [(p, what) for p in pages for what in foreign(p.read_text("utf-8"))]
    for page, what in found:
        print(f"{page} loads from elsewhere: {what}")
    return len(found)


if __name__ == "__main__":
    sys.exit(min(main(Path(sys.argv[1])), 1))
