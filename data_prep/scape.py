"""SCAPE with about 5000 vertices: the .mat files of the ACD release.

Unpacks and checks what you have downloaded, and lays it out as a folder that csm reads:

    python data_prep/scape.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.scape import RELEASE
from csm.data.unpacking import script

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [RELEASE]))
