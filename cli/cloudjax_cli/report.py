"""`cloudjax report`."""

from pathlib import Path

import click


PAGE = "report.html"


@click.command()
@click.argument("a", metavar="A")
@click.argument("b", metavar="B")
@click.option("-o", "--output", required=True, metavar="DIR", help="For the report.")
def report(a, b, output) -> None:
    """Compare two sets of radiances, band by band.

    A and B are scene folders, ABI files or files that cloudjax wrote; A is taken as the
    observed one. Writes report.html and report.json to DIR.
    """
    import importlib.metadata

    from cloudjax_data.plain_path import printable
    from cloudjax_data.whole_files import require_writable, staged
    from cloudjax_fit.comparison import compare, read_radiances
    from cloudjax_fit.report import write_comparison

    folder = Path(output)
    require_writable(folder)
    versions = {
        name: importlib.metadata.version(name) for name in ("cloudjax", "numpy")
    }
    names = printable(a), printable(b)
    comparison = compare(read_radiances(a), read_radiances(b), names, versions)
    with staged(folder, last=PAGE) as aside:
        write_comparison(aside / PAGE, comparison)
    for band in comparison.bands:
        d = band.distances
        click.echo(f"  {band.name}  W1 over std {d.w1_over_std:.3f}, KS {d.ks:.3f}")
    click.echo(f"  {folder / PAGE}")
