"""The version of the package."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("deltaopt")
except PackageNotFoundError:  # run from a folder, without being installed
    __version__ = "unknown"
