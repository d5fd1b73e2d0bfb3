"""How well a scene is rendered: the knobs that cost time and buy accuracy."""

from dataclasses import asdict, dataclass, fields, replace

from cloudjax import FractalCloud, Latent, Layer, Scene
from cloudjax_data import DataError

from .lights import Light
from .model_scene import ModelWorld
from .weather_scene import World


@dataclass(frozen=True)
class Quality:
    """A `Quality` is one choice of what a render spends time on.

    **Fields:**

    - `steps`: of the march through each shell.
    - `nodes`: sub-pixel structures that radiances are averaged over.
    - `shadows`: steps towards the sun, 0 for no shadows.
    - `scattering`: whether cloud scatters thermal radiation; else it absorbs alone.

    **Raises:** `DataError` for no steps or nodes, or less than no shadows.
    """

    steps: int = 24
    nodes: int = 5
    shadows: int = 0
    scattering: bool = True

    def __post_init__(self):
        for name, least in (("steps", 1), ("nodes", 1), ("shadows", 0)):
            value = getattr(self, name)
            if value < least:
                raise DataError(f"{name} = {value}: make it {least} or more.")

    def of_world(self, world: World | ModelWorld) -> World | ModelWorld:
        """Return a world that is rendered with this quality.

        What its kind of cloud has not, such as sub-pixel nodes of a model's own
        columns, is left out.
        """
        known = {field.name for field in fields(world)}
        own = {name: value for name, value in asdict(self).items() if name in known}
        return replace(world, **own)

    def of_scene(self, scene: Scene) -> Scene:
        """Return a scene that is rendered with this quality; shadows as it has them."""
        return replace(
            scene,
            layers=tuple(self._layer(one) for one in scene.layers),
            emission=scene.emission if self.scattering else None,
        )

    def _layer(self, layer: Layer) -> Layer:
        cloud = layer.cloud
        if isinstance(cloud, FractalCloud):
            cloud = replace(cloud, latent=Latent.equal_shares(self.nodes))
        return replace(layer, steps=self.steps, cloud=cloud)

    def with_shadows(self, steps: int) -> "Quality":
        """Return the same quality with other shadows."""
        return replace(self, shadows=steps)

    @property
    def words(self) -> str:
        """The options of `cloudjax render` that give it."""
        said = [f"--steps {self.steps}", f"--nodes {self.nodes}"]
        if self.shadows:
            said.append(f"--shadows {self.shadows}")
        if not self.scattering:
            said.append("--no-scattering")
        return " ".join(said)


# How files call the knobs that are numbers.
_ATTRIBUTES = {"steps": "steps", "nodes": "nodes", "shadows": "shadow_steps"}


def quality_attributes(
    rendered: Quality | World | ModelWorld, light: Light
) -> dict[str, str | int]:
    """Return the attributes of a file that say how it was rendered.

    Those of the knobs that are there: a model's own columns have no nodes, and not
    every light scatters thermal radiation.
    """
    numbers = {
        name: getattr(rendered, knob)
        for knob, name in _ATTRIBUTES.items()
        if hasattr(rendered, knob)
    }
    scatters = rendered.scattering and light.emission is not None
    return {"light": light.name} | numbers | {"thermal_scattering": int(scatters)}


# What a look needs, what is usual, and what others are compared with.
DRAFT = Quality(steps=6, nodes=1)
STANDARD = Quality()
REFERENCE = Quality(steps=64, nodes=15)
QUALITIES = {"draft": DRAFT, "standard": STANDARD, "reference": REFERENCE}
