using System.Runtime.CompilerServices;

[assembly: InternalsVisibleTo("Foottrack.Tests")]
