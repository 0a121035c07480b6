"""Remeshed SHREC'19 humans (about 5000 vertices) with maps onto the FAUST template.

Unpacks, checks and lays out what you have downloaded as a folder that csm reads:

    python data_prep/shrec19.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.intake import script
from csm.data.kinds import SHREC19

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [SHREC19]))
