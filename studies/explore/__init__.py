"""What does a page show that lets its reader play with a scene?"""

from .server import LOOPBACK as LOOPBACK, Pages as Pages, serve as serve
