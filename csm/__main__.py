"""``python -m csm`` is the program ``csm``."""

from csm.commands.main import main

if __name__ == "__main__":
    main()
