"""Configuration: YAML in, frozen SI models out."""

from romdam.config.job import Config
from romdam.config.load import Job, load_config, parse_config

__all__ = ["Config", "Job", "load_config", "parse_config"]
