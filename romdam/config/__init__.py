"""Configuration: YAML in, frozen SI models out."""

from romdam.config.load import Job, load_config, parse_config
from romdam.config.sections.job import Config

__all__ = ["Config", "Job", "load_config", "parse_config"]
