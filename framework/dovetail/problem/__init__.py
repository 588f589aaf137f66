"""The identification problem: observations with their random error, and the model as functions of the parameters."""

from dovetail.problem.definition import Problem

__all__ = ["Problem"]
