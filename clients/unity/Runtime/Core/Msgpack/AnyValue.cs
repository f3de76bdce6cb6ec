using System.Collections.Generic;

namespace Foottrack
{
    /// <summary>Values whose types are not known before: answers to requests. Not for the hot path: it allocates.</summary>
    internal static class AnyValue
    {
        public static object Read(MsgpackReader r)
        {
            int code = r.Code;
            if (code == 0xc0) { r.ReadNil(); return null; }
            if (code == 0xc2 || code == 0xc3) { return r.ReadBool(); }
            if (code == 0xca || code == 0xcb) { return r.ReadFloat(); }
            if (code >= 0xc4 && code <= 0xc6) { return r.ReadBytes(); }
            if ((code >= 0xa0 && code < 0xc0) || (code >= 0xd9 && code <= 0xdb)) { return r.ReadText(); }
            if ((code & 0xf0) == 0x80 || code == 0xde || code == 0xdf) { return Map(r); }
            if ((code & 0xf0) == 0x90 || code == 0xdc || code == 0xdd) { return Items(r); }
            if (code < 0x80 || code >= 0xe0 || (code >= 0xcc && code <= 0xd3)) { return r.ReadAnyInt(); }
            // An extension, which nothing here has a type for.
            r.Skip();
            return null;
        }

        private static Dictionary<string, object> Map(MsgpackReader r)
        {
            var map = new Dictionary<string, object>();
            for (int left = r.EnterMap(); left > 0; left--)
            {
                r.ReadKey();
                string key = r.KeyText();
                map[key] = Read(r);
            }
            return map;
        }

        private static object[] Items(MsgpackReader r)
        {
            var items = new object[r.EnterArray()];
            for (int i = 0; i < items.Length; i++)
            {
                items[i] = Read(r);
            }
            return items;
        }
    }
}
