"""``foottrack evaluate --sections faults``: how soon a foot is back after each fault, as a table."""

from __future__ import annotations

from typing import Any

from rich.table import Table


def fault_recovery_table(rows: dict[str, Any]) -> Table:
    """By fault and device."""
    table = Table(
        title="Back within 10 mm after a fault, in s of good measurements (0.5 at most)",
        title_justify="left",
        caption="Counted in pictures in which the foot's own tag was found; 10 mm, or 3 more than without the fault",
        caption_justify="left",
    )
    for name in ("fault", "device"):
        table.add_column(name, no_wrap=True)
    for name in ("faults", "median", "p95", "worst", "above 0.5 s", "largest error, mm"):
        table.add_column(name, justify="right", no_wrap=True)
    for fault, row in rows.items():
        for index, (device, values) in enumerate(row.items()):
            cells = (f"{values[key]:.2f}" for key in ("median", "p95", "worst"))
            late = f"{values['late']} ({values['late_share']:.1f} %)" if values["late"] else "-"
            table.add_row(
                fault if index == 0 else "",
                device,
                str(values["faults"]),
                *cells,
                late,
                f"{values['peak']:.0f}",
                end_section=index == len(row) - 1,
            )
    return table
