"""Which of several models the measurements prefer: joints, laws, shared and free values."""

from dovetail.comparison.compared_models import ComparedModel, ModelComparison
from dovetail.comparison.models import compare_models

__all__ = ["ComparedModel", "ModelComparison", "compare_models"]
