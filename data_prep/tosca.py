"""Remeshed TOSCA (about 5000 vertices) of the SGA18/BCICP set.

Unpacks, checks and lays out what you have downloaded as a folder that csm reads:

    python data_prep/tosca.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.intake import script
from csm.data.kinds import SGA18_TOSCA

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [SGA18_TOSCA]))
