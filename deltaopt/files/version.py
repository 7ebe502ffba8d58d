"""Versions of installed packages."""

from importlib.metadata import PackageNotFoundError, version


def installed_version(package: str) -> str | None:
    """The version of a package; None if it is used without being installed, as from a folder."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


__version__ = installed_version("deltaopt") or "unknown"
