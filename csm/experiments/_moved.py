"""Options that stand in another group than in earlier versions."""

from __future__ import annotations

MOVED = {f"optimizer.{name}": f"learning.{name}" for name in ("loss_products", "loss_rows", "rotate")}
"""Options of earlier versions -> where they are now."""
