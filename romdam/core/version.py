"""The version of romdam, and what files and pages say that they were made with."""

VERSION = "0.3.0.dev0"
SOURCE = f"romdam {VERSION}"
