"""Remeshed FAUST: LPS-data (8000 to 15000 vertices) and the SGA18/BCICP set (5000 vertices).

Unpacks and checks what you have downloaded, and lays it out as a folder that csm reads:

    python data_prep/faust_remeshed.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.faust import LPS, SGA18
from csm.data.unpacking import script

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [LPS, SGA18]))
