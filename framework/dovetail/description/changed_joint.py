"""Joints whose matrices are derived from those of their model."""

from __future__ import annotations

from dovetail.interfaces import JointModel, Parameter, Port


class ChangedJoint(JointModel):
    """A joint between the same nodes as another one, by the same parameters, with other matrices.

    Parameters
    ----------
    model : JointModel
        It gives matrices, and not its own dynamic stiffness.
    """

    def __init__(self, model: JointModel) -> None:
        super().__init__()
        self.name, self.summary = model.name, model.summary  # type: ignore[misc]  # for messages
        self.spans_a_distance = model.spans_a_distance
        self.Config, self.config = model.Config, model.config  # those of the description
        self.model = model

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of the model."""
        return self.model.parameters

    @property
    def ports(self) -> tuple[Port, ...]:
        """Those of the model."""
        return self.model.ports

    @property
    def internal_dofs(self) -> int:
        """Those of the model."""
        return self.model.internal_dofs

    @property
    def merged_dofs(self) -> tuple[tuple[int, int], ...]:
        """Those of the model."""
        return self.model.merged_dofs

    @property
    def facing_ports(self) -> tuple[tuple[str, str], ...]:
        """Those of the model."""
        return self.model.facing_ports

    @property
    def contact_dofs(self) -> tuple[tuple[int, int], ...]:
        """Those of the model."""
        return self.model.contact_dofs
