"""What the command line asks of the renderer, without rendering."""

import pytest


@pytest.fixture
def asked(monkeypatch):
    """The world, bands and time that were to be rendered for a sensor."""
    found = []

    def render_strips(world, sensor, bands, time, winds=None, **options):
        found.append((world, bands, time))
        return []

    monkeypatch.setattr("cloudjax_scenes.image_strips.render_strips", render_strips)
    monkeypatch.setattr("cloudjax_scenes.image_strips.write_strips", lambda *_: None)
    return found
