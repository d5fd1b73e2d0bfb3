"""How far apart in time what is compared may be, and is."""

from datetime import timedelta


# Clouds of half an hour ago are still much the same; of an hour ago fewer are.
SLACK = timedelta(minutes=30)


def in_words(time: timedelta) -> str:
    """Say a time in the unit in which it is some, but not many."""
    hours = time / timedelta(hours=1)
    if hours < 2:
        return f"{60 * hours:.0f} minutes"
    if hours < 72:
        return f"{hours:.1f} hours"
    days = hours / 24
    return f"{days:.0f} days" if days < 730 else f"{days / 365.25:.1f} years"
