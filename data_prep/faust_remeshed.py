"""Remeshed FAUST: LPS-data (8000 to 15000 vertices) and the SGA18/BCICP set (5000 vertices).

Unpacks, checks and lays out what you have downloaded as a folder that csm reads:

    python data_prep/faust_remeshed.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.intake import script
from csm.data.kinds import LPS, SGA18_FAUST

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [LPS, SGA18_FAUST]))
