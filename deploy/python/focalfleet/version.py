"""The version of the package. CMakeLists.txt has the same one; a test compares them."""

__version__ = "0.1.0"
