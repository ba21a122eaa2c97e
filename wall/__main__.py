"""python -m wall"""

from wall.cli import main

if __name__ == "__main__":
    main()
