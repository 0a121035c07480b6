"""FAUST with its own connectivity (6890 vertices): MPI-FAUST.zip, or the .mat files of the ACD release.

Unpacks, checks and lays out what you have downloaded as a folder that csm reads:

    python data_prep/faust.py DOWNLOAD... --out DATA [--store]
"""

import sys

from csm.data.intake import script
from csm.data.kinds import ACD_FAUST, MPI_FAUST

if __name__ == "__main__":
    sys.exit(script(__doc__.partition("\n")[0], [ACD_FAUST, MPI_FAUST]))
