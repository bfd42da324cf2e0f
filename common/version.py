"""The version of the software, as installed."""

from importlib.metadata import PackageNotFoundError, version

try:
    VERSION = version("autocomplete-teleoperation")
except PackageNotFoundError:
    VERSION = "0+unknown"
