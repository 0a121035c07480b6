"""Remeshed TOSCA (about 5000 vertices) of the SGA18/BCICP set.

Unpacks and checks what you have downloaded, and lays it out as a folder that csm reads:

    python data_prep/tosca.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.tosca import SGA18
from csm.data.unpacking import script

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [SGA18]))
