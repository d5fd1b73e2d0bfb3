"""`cloudjax doctor`."""

import click


WRONG = 1


@click.command()
def doctor() -> int:
    """Show versions and devices, and test compiled derivatives."""
    import platform

    import jax

    from cloudjax_fit.versions import versions

    from .self_test import derivative_error

    for name, version in {"python": platform.python_version(), **versions()}.items():
        click.echo(f"{name:<12}{version}")
    for device in jax.devices():
        click.echo(f"{'device':<12}{device.platform}:{device.id} {device.device_kind}")
    click.echo(f"{'x64':<12}{'on' if jax.config.read('jax_enable_x64') else 'off'}")
    error = derivative_error()
    click.echo(f"{'derivatives':<12}{error or 'ok'}")
    return WRONG if error else 0
