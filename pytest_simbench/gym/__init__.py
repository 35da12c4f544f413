"""Gymnasium environments: `making.make`. An extra: `pip install 'pytest-simbench[gym]'`."""
