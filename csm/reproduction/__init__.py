"""The tables and figures of the paper, declared over the evaluation engine, with the published numbers beside ours.

The names are in `csm.reproduction.study`; nothing is imported here, so that a process that measures another library
holds no more than that library needs.
"""
