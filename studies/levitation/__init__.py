"""How do true fields and slow effects change where and how long the floater levitates?"""

from .dipole_vs_fem_report import spanned

__all__ = ["spanned"]
