"""The problem of all gaps in one step: laws, and solvers in gap space."""

from romdam.contact.laws.law import Law, Parameter

__all__ = ["Law", "Parameter"]
