"""SCAPE with about 5000 vertices: the .mat files of the ACD release.

Unpacks, checks and lays out what you have downloaded as a folder that csm reads:

    python data_prep/scape.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.intake import script
from csm.data.kinds import ACD_SCAPE

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [ACD_SCAPE]))
