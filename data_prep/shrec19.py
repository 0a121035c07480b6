"""Remeshed SHREC'19 humans (about 5000 vertices) with maps onto the FAUST template.

Unpacks and checks what you have downloaded, and lays it out as a folder that csm reads:

    python data_prep/shrec19.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.shrec19 import REMESHED
from csm.data.unpacking import script

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [REMESHED]))
