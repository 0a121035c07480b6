"""What ``csm train`` and ``csm evaluate`` leave of their tests."""

from __future__ import annotations

from collections.abc import Sequence

from omegaconf import DictConfig

from csm.commands.app import output_folder
from csm.evaluation.tables import LEGEND, markdown_table
from csm.experiments.pairs import worst_line
from csm.experiments.report import write_results
from csm.experiments.testing import Tested
from csm.viewer.html import Section


def conclude(cfg: DictConfig, tested: list[Tested], notes: str, more: Sequence[Section] = ()) -> None:
    """Keep the results of a test in the folder of the job, and print the table, the worst pairs and where all is."""
    folder = output_folder()
    page = write_results(tested, folder, cfg.results, notes, more)
    print(markdown_table([t.row for t in tested]) + LEGEND)
    print(*map(worst_line, tested), sep="\n")
    for said in dict.fromkeys(t.row.protocol for t in tested):
        print(f"protocol:     {said.partition('; left-right')[0]}")
    print(f"table:        {folder / 'rows.json'}, rows.csv\nreport:       {page}")
