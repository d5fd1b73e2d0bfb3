"""What a fit spends time on, and which choices of it are measured."""

from dataclasses import dataclass, replace

from cloudjax_fit.fit_settings import QUALITIES, FitSettings


@dataclass(frozen=True)
class FitQuality:
    """A `FitQuality` is what a fit spends time on.

    **Fields:** `rays`, `steps`: as of `FitSettings`.
    """

    rays: int
    steps: int

    @property
    def words(self) -> str:
        """The options of `cloudjax fit` that ask for it."""
        return f"--rays {self.rays} --steps {self.steps}"

    @property
    def work(self) -> int:
        """What a step of the solver grows with: places at which rays are sampled."""
        return self.rays * self.steps

    def put_into(self, settings: FitSettings) -> FitSettings:
        """Return settings with these rays and steps."""
        return replace(settings, rays=self.rays, steps=self.steps)


REFERENCE, STANDARD, DRAFT = (
    FitQuality(**QUALITIES[name]) for name in ("reference", "standard", "draft")
)
# After the reference, in this order: first those that have names, then what is quicker
# than the standard, then what is not.
CHOICES = (
    STANDARD,
    DRAFT,
    FitQuality(4096, 12),
    FitQuality(1024, 12),
    FitQuality(4096, 24),
    FitQuality(8192, 12),
    FitQuality(2048, 24),
    FitQuality(1024, 24),
    FitQuality(8192, 6),
    FitQuality(16384, 24),
    FitQuality(8192, 48),
)
